"""Loads in perspective."""

from functools import partial

import numpy as np
import pytest

from unload import task
from unload.load.boxes import Load
from unload.reproduce.figures.perspective import Painter

SIZE, ROOM = (120, 100), (5, 10, 5, 10)


def pile(*boxes):
    """A load of boxes given by their low and high corners in m."""
    low, high = np.array(boxes, dtype=float).transpose(1, 0, 2)
    numbers = np.arange(len(boxes))
    return Load((low + high) / 2, high - low, numbers, numbers)


def painted(load, present=None, rise=None, shown=()):
    present = np.ones(len(load), dtype=bool) if present is None else present
    colours = np.eye(3)[np.arange(len(load)) % 3]
    rise = np.zeros(len(load)) if rise is None else rise
    return np.asarray(Painter(load, SIZE, ROOM).paint(present, colours, rise, list(shown)))


def pixels_of(picture, channel):
    """How many pixels have the colour of the boxes painted in one channel only."""
    others = [other for other in range(3) if other != channel]
    return int(((picture[..., channel] > 150) & (picture[..., others] < 30).all(axis=-1)).sum())


@pytest.mark.parametrize(
    "hiding",
    [((3, 0, 0), (4, 2, 2)), ((1, 0, 0), (3, 0.2, 2)), ((1, 0, 1.8), (3, 2, 2.4))],
    ids=["before", "left of", "above"],
)
def test_a_box_hides_what_is_behind_it_whatever_their_order(hiding):
    hidden = ((1, 0.5, 0), (2, 1, 1.5))
    for boxes, front in (((hidden, hiding), 1), ((hiding, hidden), 0)):
        load = pile(*boxes)
        alone = np.arange(2) == front
        whole = pixels_of(painted(load, alone), front)
        assert whole > 50
        assert abs(pixels_of(painted(load), front) - whole) <= 2  # its edge is blended


def test_container_fills_what_the_room_leaves():
    full = painted(pile(((0, 0, 0), task.CONTAINER)))
    rows, columns = (np.flatnonzero((full < 255).any(axis=(2, axis))) for axis in (1, 0))
    assert rows[0] >= 10 and rows[-1] <= 90 and columns[0] >= 5 and columns[-1] <= 115
    assert np.ptp(rows) >= 78 or np.ptp(columns) >= 108


def test_picked_boxes_rise_and_taken_ones_are_not_drawn():
    load = pile(((6, 0, 0), (7, 1, 1)))
    draw = partial(painted, load)
    top = [np.flatnonzero((picture[..., 0] > 250) & (picture[..., 1] < 30))[0] // SIZE[0]
           for picture in (draw(), draw(rise=np.array([1.0])))]  # fmt: skip
    assert top[1] < top[0] - 5
    assert pixels_of(draw(np.zeros(1, dtype=bool)), 0) == 0


def test_shown_boxes_are_seen_through_others():
    load = pile(((1, 0.5, 0), (2, 1, 1.5)), ((3, 0, 0), (4, 2, 2)))
    hidden = [pixels_of(painted(load, shown=shown), 0) for shown in ((), (0,))]
    assert hidden[1] > hidden[0] + 50
