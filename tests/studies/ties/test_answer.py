"""The README's figure has a line or a marker per agent, and pools no two batches."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from studies.paper.training import PAPER
from studies.results import read_table
from studies.ties.answer import TRAINED, draw_answer


@pytest.fixture(scope="module")
def panels():
    yield draw_answer().axes
    plt.close("all")


def test_each_panel_has_a_mean_and_a_line_per_agent_of_each_cell(panels):
    cells = [[*cells.values()] for cells in TRAINED.values()] + [
        ["positions_mask", "positions_no_mask"]
    ]
    for axes, names in zip(panels, cells):
        lines = [line for line in axes.lines if len(line.get_xdata()) > 2]
        assert len(lines) == sum(len(PAPER.cells[name].seeds) + 1 for name in names)
        thick = [line for line in lines if line.get_linewidth() > 2]
        assert len(thick) == len(names)


def test_the_markers_are_the_agents_in_new_containers(panels):
    drawn = [line.get_ydata() for line in panels[3].lines]
    choices = (
        read_table("ties/choice").query("noise == 'frozen'").set_index(["cell", "mask", "place"])
    )
    wanted = [
        100 * choices.loc[(cell, mask, place), "msr"]
        for cells in TRAINED.values()
        for cell in cells.values()
        for mask, place in ((False, True), (True, True), (True, False))
    ]
    for marked, values in zip(drawn, wanted, strict=True):
        assert np.sort(marked) == pytest.approx(np.sort(values))
