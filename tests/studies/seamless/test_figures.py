"""What the figures of seamless walls show."""

import numpy as np
import pandas as pd
import pytest

from studies.grid import read_grid
from studies.paper.training import PAPER
from studies.seamless import figures, verdicts

CELLS = {"with the mask": "paper_b2048_mask", "without the mask": "paper_b2048_no_mask"}


@pytest.fixture(scope="module")
def curves() -> pd.DataFrame:
    return read_grid(PAPER, cells=CELLS.values())


def test_runs_are_parted_by_the_mask(curves):
    panel = figures.runs_of(curves, CELLS)
    assert {name: len(runs) for name, runs in panel.items()} == dict.fromkeys(CELLS, 8)
    assert {run["cell"].iloc[0] for run in panel["with the mask"]} == {"paper_b2048_mask"}


@pytest.mark.parametrize("draw", [figures.fig11_loss, figures.fig12_reward])
def test_dashed_lines_are_without_the_mask(curves, draw):
    panel = figures.runs_of(curves, CELLS)
    axes = draw({"a gap of 1 mm": panel, "seamless walls": panel}).axes
    assert [each.get_title() for each in axes] == ["a gap of 1 mm", "seamless walls"]
    strong = [line for line in axes[0].lines if line.get_linewidth() > 1.5]
    assert {line.get_label(): line.get_linestyle() for line in strong} == figures.MASK_LINES
    thin = [line for line in axes[0].lines if line.get_linewidth() < 0.5]
    assert len(thin) == 16


def test_the_papers_start_and_end_are_marked(curves):
    axes = figures.fig12_reward({"one": figures.runs_of(curves, CELLS)}).axes[0]
    stars = [line.get_xydata()[0] for line in axes.lines if line.get_marker() == "*"]
    assert np.array(stars) == pytest.approx(np.array([(0, -0.7), (2e7, 0.2)]))


def test_the_line_of_jams_passes_the_papers_point(curves):
    axes = figures.draw_start_and_end({"ours": (verdicts.by_run(curves), {"marker": "o"})}).axes[0]
    bound, ours, paper = axes.lines
    at_start = np.interp(15, bound.get_xdata()[::-1], bound.get_ydata()[::-1])
    assert at_start == pytest.approx(57.7, abs=0.1) and paper.get_xydata().tolist() == [[15, 60]]
    assert len(ours.get_xdata()) == 16


def test_a_share_of_jams_is_of_all_loads():
    table = pd.DataFrame(
        [
            (0.25, 0.0, 0, 30, 0),
            (0.25, 0.0, 1, 10, 4),
            (1.0, 0.0, 0, 20, 20),
            (1.0, 0.001, 0, 20, 0),
        ],
        columns=["friction", "gap", "load", "free", "jammed"],
    )
    axes = figures.draw_jams(table, (0.35, 0.45)).axes[0]
    lines = {line.get_label(): line.get_ydata().tolist() for line in axes.lines}
    assert lines["seamless"] == [10, 100] and lines["gap 1 mm"] == [0]
