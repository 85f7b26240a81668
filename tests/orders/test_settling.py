"""Measured places that are settled, and boxes that tip."""

import numpy as np
import pytest

from tests.load.walls import of_corners, own_load
from unload import stack_load, task
from unload.load.boxes import BoxError, check_supported
from unload.orders.settling import settle as moves
from unload.orders.settling import uncarried


def settle(low, sizes, tolerance=0.005):
    """The corners of boxes that have settled."""
    low = np.array(low, float)
    sizes = np.array(sizes, float)
    moved, smaller = moves(low, sizes, task.CONTAINER, tolerance)
    assert not smaller.any()
    return low + moved


@pytest.mark.parametrize("kind", ["the paper's", "continuous sizes", "few sizes"])
def test_boxes_that_fit_stay_where_they_are_and_measured_ones_become_a_load(rng, kind):
    """Rows from wall to wall, in which no box has room to spare."""
    load = stack_load(rng, walls=6) if kind == "the paper's" else own_load(rng, kind)
    low = load.positions - load.sizes / 2
    assert (settle(low, load.sizes) == low).all()
    measured = low + rng.uniform(-0.002, 0.002, low.shape)
    found = settle(measured, load.sizes)
    check_supported(of_corners(found, load.sizes))
    assert abs(found - low)[:, 2].max() < 1e-6, "every box lies where it lay"
    assert abs(found - low).max() < 0.02


def test_a_stack_settles_by_more_than_the_tolerance():
    low = [(0, 0, 0.304 * layer) for layer in range(6)]
    for edge in (0.3, 0.308):  # with gaps of 4 mm, and with overlaps
        found = settle(low, np.full((6, 3), edge))
        assert found[:, 2] == pytest.approx(edge * np.arange(6))


def test_boxes_are_pushed_apart_to_the_side_and_back_from_the_wall():
    sizes = np.full((3, 3), 0.5)
    low = np.array([(0, 0, 0), (0, 0.496, 0), (0, 2.003, 0)])
    assert settle(low, sizes)[:, 1] == pytest.approx([0, 0.5, 2.0])
    at_the_wall = np.array([(0, 1.0, 0), (0, 1.503, 0), (0, 2.0, 0)])
    assert settle(at_the_wall, sizes)[:, 1] == pytest.approx([1.0, 1.5, 2.0])
    along = np.array([(-0.004, 0, 0), (0.496, 0.2, 0), (0.5, 1.0, 0.003)])
    assert settle(along, sizes) == pytest.approx(np.array([(0, 0, 0), (0.5, 0.2, 0), (0.5, 1, 0)]))


def test_boxes_that_share_as_much_of_depth_as_of_width_are_pushed_apart_along_depth():
    found = settle([(0, 0, 0), (0.496, 0.496, 0)], np.full((2, 3), 0.5))
    assert found == pytest.approx(np.array([(0, 0, 0), (0.5, 0.496, 0)]))


def test_the_longest_row_through_a_box_says_how_much_it_shrinks():
    """The last box stands beside a long row and a short one, which ends later; so does the first.

    Rows along y: 0.9 + 0.8 + 0.803 is 3 mm too long; the short ones have room.
    """
    corners = {"first": (0, 0), "long": (0, 0.9), "short": (0.5, 1.2), "last": (0, 1.7)}
    edges = {"first": (1, 0.9), "long": (0.5, 0.8), "short": (0.5, 0.5), "last": (1, 0.803)}
    for mirrored in (False, True):
        low = np.array([(x, y, 0) for x, y in corners.values()], float)
        sizes = np.array([(x, y, 0.5) for x, y in edges.values()])
        if mirrored:
            low[:, 1] = 2.503 - low[:, 1] - sizes[:, 1]
        smaller = moves(low, sizes, task.CONTAINER, 0.005)[1]
        shorter = np.array([0.9, 0.8, 0, 0.803]) * (1 - 2.5 / 2.503)
        assert smaller[:, 1] == pytest.approx(shorter, abs=1e-9)
        assert not smaller[:, [0, 2]].any()


@pytest.mark.parametrize(("gap", "settles"), [(0.0049, True), (0.0051, False), (0.0099, False)])
def test_a_box_may_be_off_the_floor_by_the_tolerance_and_off_another_box_by_twice(gap, settles):
    """The floor is where it is; of two boxes both may be off."""
    size = np.full((1, 3), 0.5)
    for bottom in (gap, -gap):
        assert (settle([(0, 0, bottom)], size)[0, 2] == 0) == settles
        low = [(0, 0, 0), (0, 0, 0.5 + bottom)]
        assert settle(low, np.full((2, 3), 0.5))[1, 2] == 0.5


@pytest.mark.parametrize(
    "second",
    [(0.489, 0, 0), (0, 0, 0.489), (0, 0, 0.511), (0, -0.006, 1), (0, 2.006, 0), (6.506, 0, 0)],
)
def test_larger_faults_are_left_for_a_load_to_refuse(second):
    sizes, low = np.full((2, 3), 0.5), np.array([(0, 0, 0), second], float)
    assert (settle(low, sizes) == low).all()
    with pytest.raises(BoxError):
        check_supported(of_corners(low, sizes))
    if second != (0, -0.006, 1):
        check_supported(of_corners(settle(low, sizes, 0.01), sizes))


@pytest.mark.parametrize(
    ("supports", "tips"),
    [
        ([(0.77, 1.0)], False),
        ([(0.75, 1.0)], True),  # its edge is under the centre
        ([(1.2497, 1.2)], True),  # by less than the slack
        ([(0.7, 1.0), (1.3, 1.0)], False),  # a bridge
        ([(0.7, 0.7), (1.3, 1.3)], False),  # across, from corner to corner
        ([(0.7, 0.7), (1.3, 0.7)], True),  # both at one side
    ],
)
def test_a_box_tips_if_its_centre_lies_beside_what_it_stands_on(supports, tips):
    low = np.array([(x, y, 0) for x, y in supports] + [(1.0, 1.0, 0.5)], float)
    load = of_corners(low, np.full((len(low), 3), 0.5))
    assert uncarried(load).tolist() == ([len(supports)] if tips else [])
