import numpy as np
import pytest

from unload import task
from unload.load.picture import (
    CORNERS,
    EYE,
    TARGET,
    back_to_front,
    project,
    snapshot,
)


def test_a_larger_container_is_seen_from_farther_away():
    assert project(2 * CORNERS, 2 * task.CONTAINER) == pytest.approx(project(CORNERS))


def test_whatever_is_nearest_on_a_ray_is_drawn_last(full_load, rng):
    low = full_load.positions - full_load.sizes / 2
    high = low + full_load.sizes
    drawn = back_to_front(low, high)
    assert sorted(drawn) == list(range(len(full_load)))
    rank = np.argsort(drawn)
    for target in rng.uniform(0, (7, 2.5, 2.0), (300, 3)):
        ahead = target - EYE
        enters = np.minimum((low - EYE) / ahead, (high - EYE) / ahead).max(axis=1)
        leaves = np.maximum((low - EYE) / ahead, (high - EYE) / ahead).min(axis=1)
        hit = np.flatnonzero(enters < leaves - 1e-6)
        assert hit.size
        assert hit[rank[hit].argmax()] == hit[enters[hit].argmin()]


def test_of_boxes_that_hide_each_other_in_a_circle_the_farthest_is_drawn_first():
    low = np.array([(0, 0, 0.5), (1, 0.5, 0), (0.5, 1, 1)])
    assert back_to_front(low, low + 1).tolist() == [0, 1, 2]


def test_a_snapshot_shows_the_present_boxes_where_they_are(boxes):
    load, moved = boxes((0.8, 0.2), (0.8, 0.6)), boxes((1.6, 0.2), (1.6, 0.6))
    both, one, none = (np.arange(2) < count for count in (2, 1, 0))
    picture, empty = snapshot(load, both, load.positions), snapshot(load, none, load.positions)
    assert picture.shape == (480, 640, 3) and picture.dtype == np.uint8
    lower = (snapshot(load, one, load.positions) != empty).any(axis=2).sum()
    assert 100 < lower < (picture != empty).any(axis=2).sum()
    assert (snapshot(load, both, moved.positions) == snapshot(moved, both, moved.positions)).all()
    assert (snapshot(load, both, moved.positions) != picture).any()


def test_what_stands_upright_is_drawn_upright():
    seen = project(TARGET + np.outer([-1, 0, 1], [0, 0, 1]))
    assert seen[:, 0] == pytest.approx(0) and (np.diff(seen[:, 1]) > 0).all()
