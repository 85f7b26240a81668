"""Figs. 8–10."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from unload.reproduce.figures import tuning
from unload.reproduce.tuning import running_mean, set_name
from unload.support import files

FIGURES = [
    tuning.fig08_learning_rate,
    tuning.fig09_batch_size,
    tuning.fig10_loss,
    tuning.greedy_curves,
]


@pytest.mark.parametrize("draw", FIGURES)
def test_figure_is_saved_as_the_same_bytes(draw, saved_twice):
    saved_twice(draw)


@pytest.mark.parametrize("draw", FIGURES)
def test_missing_data_names_the_command_that_makes_it(draw, names_its_command):
    names_its_command(draw)


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


def test_greedy_curves_are_means_over_the_runs():
    figure, axes = plt.subplots()
    runs = {run: np.full(100, value) for run, value in enumerate((0.25, 0.75))}
    tuning.draw_greedy(axes, {"a": runs})
    line = axes.lines[0]
    assert line.get_label() == "a"
    assert line.get_ydata()[70:] == pytest.approx(0.5)


@pytest.mark.parametrize("content", ["", "a\nb\n", "1,2\n3,4\n"])
def test_bad_tuning_curves_are_refused(tmp_path, content):
    path = tmp_path / set_name(True) / "curve.csv"
    path.parent.mkdir()
    path.write_text(content)
    with pytest.raises(ValueError, match="curve.csv (is not a column of numbers|has 2 columns)"):
        tuning.read_curve(tmp_path, "curve")
