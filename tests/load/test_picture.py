import io
from itertools import combinations, permutations

import numpy as np
import pytest
from matplotlib.image import imread

from unload import Load, task
from unload.load import picture
from unload.load.picture import (
    _LEGEND,
    _PACKAGE_COLOURS,
    COLOURS,
    CORNERS,
    EYE,
    TARGET,
    back_to_front,
    package_colour,
    project,
    snapshot,
    still,
)

RED, BLUE = (0.9, 0.1, 0.1), (0.1, 0.1, 0.9)


def pixels(low, high, colours) -> np.ndarray:
    """(height, width, 3) float, a picture of boxes."""
    legend = {}
    png = still(np.array(low, float), np.array(high, float), np.array(colours), legend, 4.0)
    return imread(io.BytesIO(png))[:, :, :3]


def seen(picture, colour) -> int:
    """Number of pixels in a colour, bright or shaded."""
    strong = np.argmax(colour)
    others = np.delete(picture, strong, axis=2).max(axis=2)
    return int((picture[:, :, strong] > 2 * others).sum())


def test_a_nearer_box_covers_a_farther_one():
    near, far = [(6, 0, 0), (7, 2, 2)], [(4, 0.5, 0.5), (5, 1.5, 1.5)]
    picture = pixels(far[:1], far[1:], [RED])
    alone, width = seen(picture, RED), picture.shape[1]
    assert (picture[:, : round(_LEGEND * width)] == 1).all(), "the legend's place"
    assert (picture[:, round(0.97 * width) :] == 1).all(), "a margin"
    for (first, one), (second, other) in permutations([(near, BLUE), (far, RED)]):
        beside = seen(pixels([first[0], second[0]], [first[1], second[1]], [one, other]), RED)
        assert beside < alone / 2


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
    empty = snapshot(load, none, load.positions).mean(axis=2) / 255
    shares = [(abs(empty - grey) < 0.006).mean() for grey in (0.87, 0.91, 0.94)]
    assert shares == pytest.approx([0.23, 0.19, 0.08], abs=0.01), "the container's sides"
    picture = snapshot(load, both, load.positions)
    assert picture.shape == (480, 640, 3) and picture.dtype == np.uint8
    boxes_drawn = [(snapshot(load, some, load.positions) != snapshot(load, none, load.positions))
                   .any(axis=2).sum() for some in (one, both)]  # fmt: skip
    assert 100 < boxes_drawn[0] < boxes_drawn[1]
    assert (snapshot(load, both, moved.positions) == snapshot(moved, both, moved.positions)).all()
    assert (snapshot(load, both, moved.positions) != picture).any()


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


def test_colours_of_packages_are_their_codes_and_begin_again():
    assert [round(255 * part) for part in package_colour(0)] == [0x1F, 0x3A, 0x5F]
    assert [round(255 * part) for part in package_colour(12)] == [0xF6, 0xE2, 0x7F]
    assert package_colour(13) == package_colour(0) and len(set(_PACKAGE_COLOURS)) == 13


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
    wall = Load.from_corners([[0, 1, 0], [3, 0, 0]], [[1, 0.3, 0.3], [1, 2.4, 2.4]])
    picture.numbered(wall, np.array([0, 1]))
    assert [*written] == ["2"]


def test_what_stands_upright_is_drawn_upright():
    seen = project(TARGET + np.outer([-1, 0, 1], [0, 0, 1]))
    assert seen[:, 0] == pytest.approx(0) and (np.diff(seen[:, 1]) > 0).all()
