"""Figs. 4–6."""

import numpy as np
import pytest

from unload.reproduce.figures import observation

FIGURES = [observation.fig04_observation, observation.fig05_histogram, observation.fig06_equalized]


@pytest.mark.parametrize("draw", FIGURES)
def test_figure_is_saved_as_the_same_bytes(draw, saved_twice):
    saved_twice(draw)


@pytest.mark.parametrize("draw", FIGURES)
def test_missing_data_names_the_command_that_makes_it(draw, names_its_command):
    names_its_command(draw)


def test_figures_show_the_stored_points():
    everything, observed, equalized = (
        observation.read_points(name)
        for name in ("all_items", "Observation", "Equalized_Observation")
    )
    (fig04,) = observation.fig04_observation().axes
    assert [len(line.get_xdata()) for line in fig04.lines] == [len(everything), len(observed)]
    assert np.array_equal(fig04.lines[1].get_xydata(), observed)
    (fig06,) = observation.fig06_equalized().axes
    assert np.array_equal(fig06.lines[0].get_xydata(), equalized)
    (fig05,) = observation.fig05_histogram().axes
    heights = [bar.get_height() for bar in fig05.patches]
    assert sum(heights) == 2 * 128
