from itertools import combinations

import numpy as np
import pytest

from tests.load.walls import of_corners
from unload import Load, task
from unload.drawing import picture
from unload.drawing.picture import (
    COLOURS,
    CORNERS,
    EYE,
    SEAM,
    TARGET,
    back_to_front,
    corners,
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
    larger = Load(load.positions, load.sizes, container=2 * task.CONTAINER)
    assert (snapshot(larger, both, load.positions) != picture).any(), "from farther away"


def test_a_box_that_is_thinner_than_the_seam_is_drawn_half_as_thick():
    low, high = corners(of_corners([(0, 0, 0)], [(1, 1, 0.004)]), np.arange(1))
    assert (high - low)[0] == pytest.approx([1 - SEAM, 1 - SEAM, 0.002])


def test_what_stands_upright_is_drawn_upright():
    seen = project(TARGET + np.outer([-1, 0, 1], [0, 0, 1]))
    assert seen[:, 0] == pytest.approx(0) and (np.diff(seen[:, 1]) > 0).all()


# Machado et al. (2009): linear RGB as seen without the long, the middle, the short cones.
BLINDNESS = {
    "protanopia": [[0.152, 1.053, -0.205], [0.115, 0.786, 0.099], [-0.004, -0.048, 1.052]],
    "deuteranopia": [[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]],
    "tritanopia": [[1.256, -0.077, -0.179], [-0.078, 0.931, 0.148], [0.005, 0.691, 0.304]],
}


@pytest.mark.parametrize("kind", BLINDNESS)
def test_the_colour_blind_tell_all_meanings_apart(kind):
    linear = np.array(list(COLOURS.values())) ** 2.2
    assert linear.max() <= 1
    seen = (linear @ np.transpose(BLINDNESS[kind])).clip(0, 1) ** (1 / 2.2)
    for (one, a), (other, b) in combinations(zip(COLOURS, seen), 2):
        assert np.linalg.norm(a - b) > 0.1, (one, other)


def test_numbers_stand_on_the_first_picks_that_are_seen(boxes, monkeypatch):
    """On a face that is not covered; a box that is hidden has none."""
    written = {}

    def write(axes, x, y, text, **style):
        written[text] = x, y

    monkeypatch.setattr("matplotlib.axes.Axes.text", write)
    load = boxes((0.3, 0.2), (0.3, 0.6), (1.0, 0.2), (1.6, 0.2))
    monkeypatch.setattr(picture, "_NUMBERED", 3)
    assert picture.numbered(load, np.array([1, 0, 2, 3])).startswith(b"\x89PNG")
    low, high = picture.corners(load, np.arange(4))
    faces = picture._faces(low, high, load.container).mean(axis=2)
    assert [*written] == ["1", "2", "3"]
    for text, item in (("1", 1), ("2", 0), ("3", 2)):
        assert any(np.allclose(written[text], face) for face in faces[item])
    written.clear()
    wall = of_corners([[0, 1, 0], [3, 0, 0]], [[1, 0.3, 0.3], [1, 2.4, 2.4]])
    picture.numbered(wall, np.array([0, 1]))
    assert [*written] == ["2"]
