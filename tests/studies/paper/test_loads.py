"""A wall seen from the entrance."""

import numpy as np
import pytest

from studies.paper.loads import wall_view
from studies.policies.robustness import front_walls
from unload.load.picture import COLOURS
from unload.load.substacks import stack_load


@pytest.fixture
def load():
    return front_walls(stack_load(np.random.default_rng(0)), 2)


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
