"""Fig. 2, and views from the side and from the entrance."""

import numpy as np
import pytest

from studies.paper.loads import fig02_containers, side_views, wall_view
from unload.load.picture import COLOURS
from unload.load.substacks import front_walls, stack_load


@pytest.fixture
def images(rng):
    """Three pictures with a white margin of two lines and one column."""
    pictures = np.full((3, 8, 10, 3), 255, np.uint8)
    pictures[:, 2:, 1:] = rng.integers(255, size=(3, 6, 9, 3))
    return pictures


def test_pictures_are_cropped_and_in_order(images):
    figure = fig02_containers(images, [7, 8, 9], columns=2)
    assert len(figure.axes) == 4
    shown = [axes.images[0].get_array() for axes in figure.axes if axes.images]
    assert np.array_equal(shown, images[:, 2:, 1:])
    assert [axes.texts[0].get_text() for axes in figure.axes[:3]] == ["7", "8", "9"]


@pytest.fixture
def load():
    return front_walls(stack_load(np.random.default_rng(0)), 2)


def test_side_views_show_each_group_in_its_colour_to_scale(load):
    everything = np.arange(len(load))
    groups = {"unseen": everything, "visible": everything[:5], "failed": everything[3:4]}
    figure = side_views(load.positions, {"first": groups, "second": {"unseen": everything}})
    assert [axes.get_title() for axes in figure.axes] == ["first", "second"]
    for line, (meaning, items) in zip(figure.axes[0].lines, groups.items(), strict=True):
        assert line.get_label() == meaning and line.get_color() == COLOURS[meaning]
        assert np.array_equal(line.get_xydata(), load.positions[items][:, [0, 2]])
    assert all(axes.get_aspect() == 1 for axes in figure.axes)
    assert [text.get_text() for text in figure.legends[0].texts] == list(groups)


def test_a_wall_view_shows_the_boxes_of_the_wall_to_scale(load):
    wall = load.walls.max()
    visible, present = np.flatnonzero(load.walls == wall)[:4], np.ones(len(load), dtype=bool)
    present[visible[0]] = False
    figure = wall_view(load, wall, {"visible": visible}, present)
    (axes,) = figure.axes
    assert axes.get_aspect() == 1
    for item, box in zip(np.flatnonzero(present & (load.walls == wall)), axes.patches, strict=True):
        meaning = "visible" if item in visible else "unseen"
        assert box.get_facecolor()[:3] == pytest.approx(COLOURS[meaning])
        assert (box.get_width(), box.get_height()) == pytest.approx(load.sizes[item, 1:])
        assert box.get_center() == pytest.approx(load.positions[item, 1:])
    assert [text.get_text() for text in figure.legends[0].texts] == ["unseen", "visible"]
