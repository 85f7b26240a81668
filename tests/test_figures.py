"""The figures of the paper: what they show comes from the data."""

import json

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest

from unload import files
from unload.figures import observation, training, tuning
from unload.figures.lifting import lift_sequences
from unload.figures.mdp import fig01_mdp
from unload.figures.network import fig07_network
from unload.figures.style import save
from unload.figures.substacks import fig03_substacks, rows
from unload.tuning import running_mean, set_name

matplotlib.use("Agg")


@pytest.fixture(autouse=True)
def close_figures():
    yield
    plt.close("all")


FROM_DATA = [
    observation.fig04_observation,
    observation.fig05_histogram,
    observation.fig06_equalized,
    tuning.fig08_learning_rate,
    tuning.fig09_batch_size,
    tuning.fig10_loss,
    training.fig11_loss,
    training.fig12_reward,
]


@pytest.mark.parametrize("draw", [fig01_mdp, fig03_substacks, fig07_network, *FROM_DATA])
def test_figure_is_saved_as_the_same_bytes(draw, tmp_path):
    for folder in ("a", "b"):
        save(draw(), draw.__name__, tmp_path / folder)
    for suffix in ("png", "pdf"):
        first, second = (tmp_path / folder / f"{draw.__name__}.{suffix}" for folder in "ab")
        assert first.read_bytes() == second.read_bytes()
        assert first.stat().st_size > 5000


@pytest.mark.parametrize("draw", FROM_DATA)
def test_missing_data_names_the_command_that_makes_it(draw, tmp_path):
    with pytest.raises(FileNotFoundError, match="python -m unload.reproduce"):
        draw(tmp_path)


def test_learning_rate_figure_draws_the_stored_curves():
    drawn = [line.get_ydata() for line in tuning.fig08_learning_rate().axes[0].lines]
    stored = tuning.read_curve(files.DATA, "hitrate_curve_bz_1024_lr_0.001_agent_5")
    assert any(np.array_equal(curve, running_mean(stored)) for curve in drawn)


def test_strong_lines_are_the_papers_runs():
    figure, axes = plt.subplots()
    runs = {run: np.full(30, run / 10) for run in (2, 5, 7)}
    tuning.draw_curves(axes, {"a": (runs, 5), "b": (runs, 6)}, "MSR")
    named = {line.get_label(): line.get_ydata()[0] for line in axes.lines if line.get_zorder() == 3}
    assert named == {"a": 0.5, "b": 0.2}  # the first one where the paper's is missing
    assert len(axes.lines) == 6


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("Step,Value\n1,2\n", r"has columns \['Step', 'Value'\]; expected \['Wall time', "),
        ("Wall time,Step,Value\n", "has no rows; expected at least one"),
        ("Wall time,Step,Value\n1,2,\n", "holds nan"),
    ],
)
def test_bad_training_curves_are_refused(tmp_path, content, message):
    (tmp_path / "loss_function_agent.csv").write_text(content)
    with pytest.raises(ValueError, match=f"loss_function_agent.csv {message}"):
        training.read_curve(tmp_path, "loss_function_agent")


@pytest.mark.parametrize("content", ["", "a\nb\n", "1,2\n3,4\n"])
def test_bad_tuning_curves_are_refused(tmp_path, content):
    path = tmp_path / set_name(True) / "curve.csv"
    path.parent.mkdir()
    path.write_text(content)
    with pytest.raises(ValueError, match="curve.csv (is not a column of numbers|has 2 columns)"):
        tuning.read_curve(tmp_path, "curve")


@pytest.mark.parametrize(
    ("combinations", "message"),
    [
        ([(0, 0, 0, -1)], "combinations holds -1 to 0; expected 0 to 2"),
        ([(0,)], r"combinations has shape \(1, 1\); expected \(any, 4\)"),
        ([], "combinations has shape"),
    ],
)
def test_bad_rows_are_refused(combinations, message):
    with pytest.raises(ValueError, match=message):
        rows(combinations)
    assert len(rows([(0, 1, 2, 0)]).axes) == 1


def test_bad_lift_sequences_are_refused():
    sizes, poses = np.ones((2, 2)), np.zeros((1, 2, 3))
    for lifts, times, error, message in (
        ({}, [0.0], ValueError, "lifts has 0 and times 1 entries; expected at least one"),
        ({"a": (sizes, poses)}, [], ValueError, "lifts has 1 and times 0 entries"),
        ([1], [0.0], TypeError, r"lifts is \[1\]; expected a dict"),
        ({"a": (sizes, poses)}, [0.0, 0.1], ValueError, "poses of 'a' has shape"),
    ):
        with pytest.raises(error, match=message):
            lift_sequences(lifts, times)
    assert len(lift_sequences({"a": (sizes, poses)}, [0.0]).axes) == 1


@pytest.mark.parametrize("reduced", [True, False])
def test_a_reduced_run_says_so(tmp_path, reduced):
    for name in ("loss_function_agent.csv", "training.provenance.json"):
        (tmp_path / name).write_text((files.DATA / name).read_text())
    path = tmp_path / "training.provenance.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"reduced": reduced}))
    note = training.fig11_loss(tmp_path).get_supxlabel()
    assert ("reduced run" in note) == reduced


def test_every_figure_of_the_paper_is_committed():
    for suffix in ("png", "pdf"):
        numbers = sorted(path.name[:5] for path in files.FIGURES.glob(f"fig*.{suffix}"))
        assert numbers == [f"fig{number:02d}" for number in range(1, 13)]
