"""Figs. 4–6, and what is visible."""

import numpy as np
import pytest

from unload.env.observation import distance, nearest
from unload.load.colours import COLOURS
from unload.load.substacks import stack_load
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


def test_visibility_draws_the_line_through_the_farthest_visible_item():
    load = stack_load(np.random.default_rng(0))
    visible = nearest(load.positions)
    (axes,) = observation.visibility(load.positions, visible).axes
    unseen, seen, viewpoint = axes.lines
    assert len(unseen.get_xdata()) + len(seen.get_xdata()) == len(load)
    assert seen.get_color() == COLOURS["visible"]
    assert viewpoint.get_xydata().tolist() == [[7.0, 2.5]]
    (border,) = [each for each in axes.collections if len(each.levels) == 1]
    points = border.get_paths()[0].vertices
    distances = distance(np.insert(points, 1, 0.0, axis=1))
    assert np.allclose(distances, distance(load.positions[visible]).max(), atol=0.01)
    assert axes.get_aspect() == 1
