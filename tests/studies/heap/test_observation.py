import numpy as np
import pytest

from studies.heap.observation import (
    COLUMN,
    COLUMNS,
    PIXELS_HIGH,
    PIXELS_WIDE,
    ROWS,
    SEEN,
    Camera,
    Scan,
    SeenBoxes,
    camera_boxes,
    features,
    true_boxes,
    visible_boxes,
)


@pytest.fixture(scope="module")
def camera():
    made = Camera()
    yield made
    made.close()


def column(rows: np.ndarray, name: str) -> np.ndarray:
    return rows[rows.any(axis=1), COLUMN[name]]


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


def test_boxes_with_few_pixels_are_not_visible_unless_there_are_no_others(camera, pile):
    scan = camera.scan(pile)
    few = type(scan)(np.array([SEEN, SEEN - 1, 0]), scan.points, scan.owners)
    none = type(scan)(np.array([SEEN - 1, 0, 0]), scan.points, scan.owners)
    assert visible_boxes(few).tolist() == [0]
    assert visible_boxes(none).tolist() == [0, 1, 2]


def test_features_of_upright_cubes(camera, cubes):
    heap = cubes((5.0, 1.0, 0), (5.0, 1.0, 1), (6.0, 2.0, 0))
    seen = true_boxes(heap, camera.scan(heap))
    assert sorted(seen.numbers.tolist()) == [0, 1, 2] and seen.numbers[0] == 2
    rows = features(seen)
    assert rows.shape == (ROWS, len(COLUMNS)) and rows.dtype == np.float32
    order = np.argsort(seen.numbers)
    assert column(rows, "behind")[order] == pytest.approx([1.2, 1.2, 0.2])
    assert column(rows, "y")[order] == pytest.approx([-0.25, -0.25, 0.75])
    assert column(rows, "z")[order] == pytest.approx([0.2, 0.6, 0.2])
    for name in ("extent_x", "extent_y", "extent_z", "longest", "middle", "shortest"):
        assert column(rows, name) == pytest.approx([0.4, 0.4, 0.4])
    assert column(rows, "tilt") == pytest.approx([0, 0, 0], abs=1e-6)
    assert column(rows, "clear_above")[order] == pytest.approx([0, 1, 1], abs=1e-6)
    assert column(rows, "clear_in_front")[order] == pytest.approx([1, 1, 1], abs=1e-6)
    assert (column(rows, "pixels") * 1000 >= 4).all()


def test_a_box_half_in_front_covers_half(camera, cubes):
    heap = cubes((5.0, 1.0, 0), (5.5, 1.2, 0))
    seen = true_boxes(heap, camera.scan(heap))
    rows = features(seen)
    assert column(rows, "clear_in_front")[np.argsort(seen.numbers)] == pytest.approx([0.5, 1])


def test_boxes_outside_the_door_do_not_move_the_edge(camera, cubes):
    heap = cubes((6.0, 1.0, 0), (7.1, 2.0, 0))
    rows = features(true_boxes(heap, camera.scan(heap)))
    assert column(rows, "behind") == pytest.approx([0.1, 1.2])


def test_the_camera_knows_the_part_that_shows(camera, pile):
    scan = camera.scan(pile)
    true, seen = true_boxes(pile, scan), camera_boxes(pile, scan)
    assert sorted(seen.numbers) == sorted(true.numbers)
    order = [seen.numbers.tolist().index(box) for box in true.numbers.tolist()]
    assert (seen.extents[order] <= true.extents + 0.05).all()
    assert np.abs(seen.centres[order] - true.centres).max() < 0.4
    front = seen.centres[:, 0] + seen.extents[:, 0] / 2
    assert front.max() == pytest.approx(pile.front(), abs=0.05)


def test_without_any_visible_box_all_are_seen(cubes):
    heap = cubes((5, 1, 0), (6, 1, 0))
    blind = Scan(np.zeros(2, int), np.zeros((0, 3)), np.zeros(0, int))
    for look in (true_boxes, camera_boxes):
        assert look(heap, blind).numbers.tolist() == [1, 0]
    half_blind = Scan(np.array([1, 0]), np.zeros((1, 3)), np.zeros(1, int))
    assert camera_boxes(heap, half_blind).numbers.tolist() == [1, 0]


def test_only_the_foremost_boxes_get_a_row():
    count = ROWS + 10
    centres = np.column_stack([np.linspace(4, 7, count), np.ones(count), np.ones(count)])
    blocks = np.full((count, 3), 0.1)
    seen = SeenBoxes(
        np.arange(count), centres, blocks, blocks, np.zeros(count), np.full(count, 9)
    ).ordered()
    assert seen.numbers.tolist() == list(range(count - 1, 9, -1))
