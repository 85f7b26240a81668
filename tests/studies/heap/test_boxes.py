import numpy as np
import pytest

from studies.heap.boxes import DOOR, FARTHEST_EDGE, REAR, Heap, package_sizes


def turned(angle: float, axis: int) -> Heap:
    """One box of 0.6 × 0.4 × 0.2 m, turned about one of the container's axes."""
    turn = np.zeros(4)
    turn[axis], turn[3] = np.sin(angle / 2), np.cos(angle / 2)
    return Heap(np.array([[5.0, 1, 1]]), turn[None], np.array([[0.6, 0.4, 0.2]]), np.array([0]))


def test_extents_of_turned_boxes_are_those_of_their_corners():
    corners = np.array([(x, y, z) for x in (-0.3, 0.3) for y in (-0.2, 0.2) for z in (-0.1, 0.1)])
    for axis in range(3):
        heap = turned(0.7, axis)
        places = corners @ heap.axes()[0].T
        assert heap.extents()[0] == pytest.approx(np.ptp(places, axis=0))


@pytest.mark.parametrize(("angle", "tilt"), [(0.3, 0.3), (np.pi / 2, 0), (2.0, 2.0 - np.pi / 2)])
def test_tilt_is_measured_from_the_nearest_axis(angle, tilt):
    assert turned(angle, 0).tilts()[0] == pytest.approx(tilt, abs=1e-6)
    assert turned(angle, 2).tilts()[0] == pytest.approx(0, abs=1e-6)


def test_the_edge_is_at_the_front_but_does_not_give_way_beyond_the_door(cubes):
    assert cubes((5, 1, 0), (6, 1, 0)).edge() == pytest.approx(6.2)
    assert cubes((5, 1, 0), (7.1, 1, 0)).edge() == FARTHEST_EDGE
    assert cubes((5, 1, 0)).only(np.array([], int)).edge() == REAR
    assert DOOR < FARTHEST_EDGE < 7.3


def test_packages_have_the_sizes_of_the_neat_loads():
    assert package_sizes(np.array([0]))[0] == pytest.approx([7 / 12, 25 / 36, 15 / 36])
