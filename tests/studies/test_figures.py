"""Every figure is drawn, and saved as the same bytes; and what some of them show."""

import json
import re
from functools import partial

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from studies import paths, style
from studies.falls import figures as falls
from studies.falls.laboratory import read_laboratory, read_trace
from studies.falls.long import read_long_trace
from studies.grid import read_grid
from studies.lifts import figures as lifts
from studies.lifts.agreement import read_agreement
from studies.paper import diagrams, figures, loads, observation
from studies.paper.training import PAPER
from studies.paper.tuning import read_curves, running_mean
from studies.policies import figures as policies
from studies.policies.variants import GRIDS, variants_msr
from studies.speed.figures import speed_ratios
from unload import stack_load, task
from unload.env.observation import nearest
from unload.load.picture import COLOURS

LOAD = stack_load(np.random.default_rng(0))
VISIBLE = nearest(LOAD.positions)
POSES = np.zeros((2, 2, 3))
LINE = np.arange(3.0)

# Figures that are drawn from data/, and take its folder.
FROM_DATA = {
    "fig04_observation": observation.fig04_observation,
    "fig05_histogram": observation.fig05_histogram,
    "fig06_equalized": observation.fig06_equalized,
    "fig08_learning_rate": figures.fig08_learning_rate,
    "fig09_batch_size": figures.fig09_batch_size,
    "fig10_loss": figures.fig10_loss,
    "tuning_greedy": figures.greedy_curves,
    "fig11_loss": figures.fig11_loss,
    "fig12_reward": figures.fig12_reward,
    **{f"variants_{grid}": partial(variants_msr, grid) for grid in GRIDS},
    "comparison": policies.comparison_msr,
    "why_60": lambda folder=paths.DATA: falls.four_cells(read_grid(PAPER, folder)),
    "why_runs_fall": lambda folder=paths.DATA: falls.loop(
        read_trace(folder), read_laboratory(folder)
    ),
    "a_fall": lambda folder=paths.DATA: falls.fall(read_long_trace(folder).head(40)),
    "what_holds_runs": lambda folder=paths.DATA: falls.ends(
        read_laboratory(folder), {"ranks": "ranks", "shuffled": "places dealt anew"}
    ),
}
# The others, with what they are given here.
FIGURES = FROM_DATA | {
    "fig01_mdp": diagrams.fig01_mdp,
    "fig02_containers": lambda: loads.fig02_containers(
        np.arange(3 * 48).reshape(3, 4, 4, 3).astype(np.uint8), [1, 2, 3]
    ),
    "fig03_substacks": loads.fig03_substacks,
    "fig07_network": diagrams.fig07_network,
    "side_views": lambda: loads.side_views(LOAD.positions, {"": {"visible": VISIBLE}}),
    "wall_view": lambda: loads.wall_view(LOAD, 11, {"visible": VISIBLE}),
    "visibility": lambda: observation.visibility(LOAD.positions, VISIBLE),
    "distance_curves": lambda: lifts.distance_curves(
        {"force (N)": {"one box": (LINE, LINE, LINE)}}, {"force (N)": 20}
    ),
    "lift_sequences": lambda: lifts.lift_sequences({"a": (np.ones((2, 2)), POSES)}, [0.0, 0.3]),
    "agreement_scatter": lambda: lifts.agreement_scatter(read_agreement()),
    "speed_ratios": speed_ratios,
    "learning": lambda: policies.learning(
        pd.DataFrame({"picks": LINE, "success_rate": 0.5, "epsilon": 1.0, "loss": 0.1}),
        pd.Series(LINE / 3),
    ),
    "preferences": lambda: policies.preferences(
        LINE, {"front": LINE}, LINE, np.add.outer(LINE, LINE)
    ),
    "steps": lambda: policies.steps(np.full((2, 2), 0.3), 0.4, np.ones((3, 3))),
    "surfaces": lambda: falls.surfaces({"level": (LINE, LINE + 1), "dug": (LINE, LINE)}),
    "laboratory_runs": lambda: falls.laboratory_runs(
        {"a run": pd.DataFrame({"picks": LINE, "success_rate": LINE / 2})}
    ),
}


@pytest.mark.parametrize("name", FIGURES)
def test_a_figure_is_saved_as_the_same_bytes(name, tmp_path, monkeypatch):
    """In few dots and with its margins, which takes half the time."""
    quick = {"savefig.dpi": 50, "savefig.bbox": "standard", "pdf.fonttype": 3}
    monkeypatch.setattr(style, "STYLE", [style.STYLE, quick])
    for folder in ("a", "b"):
        style.save(FIGURES[name](), name, tmp_path / folder)
    for suffix in ("png", "pdf"):
        first, second = (tmp_path / folder / f"{name}.{suffix}" for folder in "ab")
        assert first.read_bytes() == second.read_bytes()
        assert first.stat().st_size > 500


@pytest.mark.parametrize("name", FROM_DATA)
def test_missing_data_name_the_command_that_makes_them(name, tmp_path):
    with pytest.raises(FileNotFoundError, match="python -m studies"):
        FROM_DATA[name](tmp_path)


def test_the_tuning_figures_draw_running_means_with_the_papers_runs_strong():
    lines = figures.fig08_learning_rate().axes[0].lines
    strong = [line for line in lines if line.get_zorder() == 3]
    assert len(lines) == 30 and len(strong) == 3
    for line, rate, run in zip(strong, (1e-1, 1e-2, 1e-3), (6, 7, 5)):
        stored = read_curves("success_rate", 1024, rate)[run]
        assert np.array_equal(line.get_ydata(), running_mean(stored))


def test_greedy_curves_are_means_over_the_runs():
    _, axes = plt.subplots()
    runs = {run: np.full(100, value) for run, value in enumerate((0.25, 0.75))}
    figures.draw_greedy(axes, {"a": runs})
    assert axes.lines[0].get_ydata()[70:] == pytest.approx(0.5)


def test_a_learning_curve_is_drawn_over_whole_episodes():
    picks = np.arange(1, 101) * 640
    curve = pd.DataFrame({"picks": picks, "success_rate": np.tile([0.2, 0.6], 50)})
    _, axes = plt.subplots()
    figures.draw_learning_curve(axes, curve.assign(wall_time=0, epsilon=0), "run")
    points, episodes = axes.lines
    assert len(points.get_ydata()) == 100
    assert episodes.get_xdata().tolist() == [16_000, 48_000]
    assert episodes.get_ydata() == pytest.approx([0.4, 0.4])


def test_picks_and_values_are_drawn_by_their_meaning():
    _, axes = plt.subplots()
    figures.draw_values(axes, LINE / 3, np.zeros(3), np.array([True, False, True]))
    blocked, liftable = axes.collections
    assert (len(blocked.get_offsets()), len(liftable.get_offsets())) == (1, 2)
    _, axes = plt.subplots()
    figures.draw_picks(axes, np.array([7, 7, 9]), np.array([False, False, True]))
    failed, unloaded = axes.collections
    assert failed.get_offsets().tolist() == [[0, 7], [1, 7]]
    assert unloaded.get_offsets().tolist() == [[2, 9]]


def test_the_colour_of_the_chosen_box_says_whether_it_was_lifted():
    sizes, lifted = np.ones((2, 2)), POSES.copy()
    lifted[1, 0, 1] = task.LIFT_THRESHOLD
    both = {"stays": (sizes, POSES), "moves": (sizes, lifted)}
    figure = lifts.lift_sequences(both, [0.0, 0.3])
    colours = [axes.patches[0].get_facecolor()[:3] for axes in figure.axes]
    blocked, liftable = COLOURS["blocked"], COLOURS["liftable"]
    assert np.allclose(colours, [blocked, blocked, liftable, liftable])


def test_the_published_figures_are_those_that_notebooks_save():
    saved = set()
    for path in (paths.ROOT / "notebooks").rglob("*.ipynb"):
        for cell in json.loads(path.read_text())["cells"]:
            if cell["cell_type"] == "code":
                saved |= set(re.findall(r"\bsave\(.*, \"(\w+)\"\)", "".join(cell["source"])))
    assert {path.stem for path in paths.FIGURES.glob("*.png")} == saved
    assert {f"fig{number:02d}" for number in range(1, 13)} <= {name[:5] for name in saved}
