import numpy as np
import pytest

from unload.heap.camera import PIXELS_HIGH, PIXELS_WIDE, SEEN, Camera, visible_boxes


@pytest.fixture(scope="module")
def camera():
    made = Camera()
    yield made
    made.close()


def test_points_lie_on_the_faces_of_their_boxes(camera, pile):
    """Within the 3 cm that a pixel is wide on a slanted face."""
    scan = camera.scan(pile)
    axes = pile.axes()[scan.owners]
    local = np.einsum("nji,nj->ni", axes, scan.points - pile.positions[scan.owners])
    outside = (np.abs(local) - pile.sizes[scan.owners] / 2).max(axis=1)
    assert np.abs(outside).max() < 0.03 and np.abs(np.median(outside)) < 0.01


def test_pixels_are_counted_by_box(camera, pile):
    scan = camera.scan(pile)
    assert scan.pixels.tolist() == np.bincount(scan.owners, minlength=len(pile)).tolist()
    assert len(scan.points) == scan.pixels.sum() < PIXELS_WIDE * PIXELS_HIGH


def test_a_box_behind_another_is_not_visible(camera, cubes):
    heap = cubes((6.5, 1.25, 0), (6.5, 1.25, 1), (6.5, 1.25, 2), (6.5, 1.25, 3), (4.5, 1.25, 0))
    assert visible_boxes(camera.scan(heap)).tolist() == [0, 1, 2, 3]
    assert camera.scan(heap.only(np.array([4]))).pixels[0] > 50


def test_a_scan_depends_on_nothing_before(camera, pile, cubes):
    first = camera.scan(pile)
    camera.scan(cubes((5, 1, 0)))
    again = camera.scan(pile)
    assert again.points.tobytes() == first.points.tobytes()
    assert again.owners.tobytes() == first.owners.tobytes()


def test_boxes_with_few_pixels_are_not_visible_unless_there_are_no_others(camera, pile):
    scan = camera.scan(pile)
    few = type(scan)(np.array([SEEN, SEEN - 1, 0]), scan.points, scan.owners)
    none = type(scan)(np.array([SEEN - 1, 0, 0]), scan.points, scan.owners)
    assert visible_boxes(few).tolist() == [0]
    assert visible_boxes(none).tolist() == [0, 1, 2]
