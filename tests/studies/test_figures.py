"""Every figure is drawn, and saved as the same bytes; and what some of them show."""

import json
import re
from functools import partial

import numpy as np
import pytest

from studies import paths, style
from studies.falls import figures as falls
from studies.falls.laboratory import read_laboratory, read_trace
from studies.falls.long import read_long_trace
from studies.grid import read_grid
from studies.paper import diagrams, tuning
from studies.paper.training import PAPER
from studies.paper.visible_items import scaled_side_view
from studies.policies.comparison import comparison_msr
from studies.policies.variants import PARTS, variants_msr

LINE = np.arange(3.0)
RUNS = {"a": ({0: LINE, 3: 2 * LINE}, 3), "with FE": ({1: LINE}, 1)}

# Figures that are drawn from data/, and take its folder.
FROM_DATA = {
    **{f"variants_{part}": partial(variants_msr, part) for part in PARTS},
    "comparison": comparison_msr,
    "why_60": lambda folder=paths.DATA: falls.four_cells(read_grid(PAPER, folder)),
    "why_runs_fall": lambda folder=paths.DATA: falls.loop(
        read_trace(folder), read_laboratory(folder)
    ),
    "a_fall": lambda folder=paths.DATA: falls.fall(read_long_trace(folder).head(40)),
    "what_keeps_runs_up": lambda folder=paths.DATA: falls.ends(
        read_laboratory(folder), {"ranks": "ranks", "shuffled": "shuffled places"}
    ),
}
# The others, with what they are given here.
FIGURES = FROM_DATA | {
    "fig01_mdp": diagrams.fig01_mdp,
    "fig03_substacks": diagrams.fig03_substacks,
    "fig07_network": diagrams.fig07_network,
    "scaled_side_view": lambda: scaled_side_view({"items": (np.eye(2), "C0")}, "p"),
    "over_steps": lambda: tuning.over_steps(RUNS, "MSR"),
    "dug": lambda: falls.dug(np.eye(3), (0.5, -0.2), False, 0.6),
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


def test_curves_are_running_means_and_the_papers_run_is_strong():
    figure = tuning.over_steps(RUNS, "MSR")
    lines = figure.axes[0].lines
    assert [line.get_zorder() == 3 for line in lines] == [False, True, True]
    for line, run in zip(lines, (LINE, 2 * LINE, LINE)):
        assert np.array_equal(line.get_ydata(), tuning.running_mean(run))
    labels = [text.get_text() for text in figure.axes[0].get_legend().texts]
    assert labels == ["a, run 3", "with FE"]


def test_the_published_figures_are_those_that_notebooks_save():
    saved = set()
    for path in (paths.ROOT / "notebooks").rglob("*.ipynb"):
        for cell in json.loads(path.read_text())["cells"]:
            if cell["cell_type"] == "code":
                saved |= set(re.findall(r"\bsave\(.*, \"(\w+)\"\)", "".join(cell["source"])))
    assert {path.stem for path in paths.FIGURES.glob("*.png")} == saved
    assert {f"fig{number:02d}" for number in range(1, 13)} <= {name[:5] for name in saved}
