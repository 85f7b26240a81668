import io
from itertools import permutations

import numpy as np
from matplotlib.image import imread

from unload.load.still import EYE, back_to_front, project, still
from unload.load.substacks import package_colour

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
    alone = seen(pixels(far[:1], far[1:], [RED]), RED)
    for (first, one), (second, other) in permutations([(near, BLUE), (far, RED)]):
        beside = seen(pixels([first[0], second[0]], [first[1], second[1]], [one, other]), RED)
        assert beside < alone / 2


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


def test_boxes_in_a_circle_are_all_drawn():
    low = np.array([(0, 0, 0), (0, 1, 1), (1, 0.5, 0.2)], float)
    assert sorted(back_to_front(low, low + 0.9)) == [0, 1, 2]


def test_nothing_is_drawn_of_no_boxes():
    picture = pixels(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)))
    assert seen(picture, RED) == seen(picture, BLUE) == 0


def test_the_colours_of_boxes_and_of_the_ground_are_kept():
    """Although many colours are reduced to few."""
    low = np.array([(1 + number / 3, 0, 0) for number in range(13)])
    names = {f"package {number}": package_colour(number) for number in range(13)}
    png = still(low, low + (0.3, 2, 1), np.array([*names.values()]), names, 4.0)
    shown = np.rint(255 * imread(io.BytesIO(png))[:, :, :3])
    legend, boxes = shown[:, :110], shown[:, 110:]
    for colour in names.values():
        for part in (legend, boxes):
            assert (part == np.rint(255 * np.array(colour))).all(axis=2).any()
    assert (shown[-1] == 255).all()


def test_what_is_up_is_seen_higher():
    points = np.array([(3.5, 1.2, 0), (3.5, 1.2, 1), (3.5, 2.2, 0)])
    floor, above, to_the_right = project(points)
    assert above[1] > floor[1] and to_the_right[0] > floor[0]
    assert EYE[0] > 7
