import numpy as np
import pytest

from unload import task
from unload.env import observation


@pytest.mark.parametrize("container", [(7.0, 2.5, 2.5), (12.0, 2.0, 3.0)])
def test_distance_is_the_papers_formula_from_the_containers_own_entrance(rng, container):
    points = rng.uniform(0, container, (50, 3))
    # The square root of the squares along x, y and z with the weights 1, 0 and 4.
    expected = np.hypot(container[0] - points[:, 0], 2 * (container[2] - points[:, 2]))
    own = () if container[0] == 7 else (np.array(container),)  # the paper's is the default
    assert observation.distance(points, *own) == pytest.approx(expected)
    assert observation.nearest(points, 5, *own).tolist() == np.argsort(expected)[:5].tolist()
    assert observation.scale(np.array(container) / 4, *own).tolist() == [-0.5, -0.5, -0.5]


def test_ties_go_to_the_smaller_index():
    positions = np.tile([5.0, 1.0, 1.0], (6, 1))
    positions[:, 1] = [0.1, 2.0, 0.5, 1.0, 1.5, 0.3]  # y does not count
    positions[4, 0] = 6.0
    assert observation.nearest(positions, 4).tolist() == [4, 0, 1, 2]


def test_all_items_are_observed_if_there_are_fewer(rng):
    positions = rng.uniform(0, task.CONTAINER, (127, 3))
    rows = observation.nearest(positions)
    assert (rows == np.argsort(observation.distance(positions))).all()
    assert observation.nearest(np.zeros((0, 3))).shape == (0,)


def test_rows_that_hold_an_item(rng):
    seen = rng.uniform(-1, 1, (2, 3, 6, 3)).astype(np.float32)
    seen[0, 1, 4:] = -1
    seen[1, 2, :, :2] = -1  # in the corner in two of three columns
    expected = np.ones((2, 3, 6), bool)
    expected[0, 1, 4:] = False
    held = observation.holds_item(seen)
    assert held.dtype == bool and (held == expected).all()
