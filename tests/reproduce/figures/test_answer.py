"""The figures of the plan's runs."""

import numpy as np
import pytest

from unload.reproduce.answer import read_answer
from unload.reproduce.figures import answer
from unload.reproduce.interventions import read_interventions
from unload.reproduce.verdict import end_msr

RUNS = [(cell, seed, curve) for cell, seed, curve in read_answer() if cell in answer.PAPER_CELLS]


@pytest.mark.parametrize("draw", [answer.cells_msr, answer.cell_curves])
def test_figure_is_saved_as_the_same_bytes(draw, saved_twice):
    saved_twice(draw)


def test_every_run_is_a_dot():
    axes = answer.cells_msr().axes[0]
    dots = np.concatenate([line.get_xdata() for line in axes.lines if line.get_marker() == "o"])
    np.testing.assert_allclose(np.sort(dots), np.sort([end_msr(curve) for *_, curve in RUNS]))


def test_every_run_is_a_curve():
    figure = answer.cell_curves()
    assert sum(len(axes.lines) - 1 for axes in figure.axes if axes.get_visible()) == len(RUNS)


def test_every_changed_run_is_a_curve(saved_twice):
    changes = {"nothing": "control", "failures_kept": "kept"}
    panels = answer.intervention_curves(changes).axes
    runs = [change for change, _, _ in read_interventions() if change in changes]
    assert len(panels) == 2 and sum(len(axes.lines) - 2 for axes in panels) == len(runs) >= 10
    saved_twice(lambda: answer.intervention_curves(changes))


def test_the_replay_holds_the_failures_of_the_latest_picks():
    figure = answer.falls_and_replay("paper_mask", [0], 64_000)  # two points of the curve
    curve = next(curve for cell, seed, curve in RUNS if (cell, seed) == ("paper_mask", 0))
    drawn = figure.axes[1].lines[0].get_ydata()
    rate = curve["success_rate"].to_numpy()
    np.testing.assert_allclose(drawn[1:], 1 - (rate[1:] + rate[:-1]) / 2, atol=1e-12)


def test_survival_is_drawn_beside_a_constant_chance():
    axes = answer.survival({"one": np.array([0, 2, 500, 500])}).axes[0]
    seen, constant = (line.get_ydata() for line in axes.lines)
    assert seen[[0, 1, 3, 500]].tolist() == [1, 0.75, 0.5, 0.5]
    chance = 2 / (0 + 2 + 2 * 500 + 2)  # mistakes over picks
    np.testing.assert_allclose(constant, (1 - chance) ** np.arange(501))


def test_bad_input_is_refused(tmp_path):
    with pytest.raises(ValueError, match="cells is 'neither'"):
        answer.cells_msr({"neither": ""})
    with pytest.raises(ValueError, match="none has a run"):
        answer.cell_curves(folder=tmp_path)
    with pytest.raises(ValueError, match="changes is 'tea'"):
        answer.intervention_curves({"tea": ""})
    with pytest.raises(ValueError, match="none has a run"):
        answer.intervention_curves({"nothing": ""}, folder=tmp_path)
    with pytest.raises(ValueError, match="seeds is 99"):
        answer.falls_and_replay("paper_mask", [99], 2**20)
    with pytest.raises(ValueError, match="before is empty"):
        answer.survival({})
