import numpy as np
import pytest

from studies.heap.boxes import Heap
from studies.heap.observation import (
    COLUMN,
    COLUMNS,
    ROWS,
    SEEN,
    Camera,
    features,
    visible_boxes,
)


@pytest.fixture(scope="module")
def camera():
    made = Camera()
    yield made
    made.close()


@pytest.fixture
def observed(camera):
    """``observed(heap)``: numbers of the visible boxes, and the rows that hold one."""

    def observe(heap: Heap) -> tuple[np.ndarray, np.ndarray]:
        pixels = camera.pixels(heap)
        visible = visible_boxes(heap, pixels)
        rows = features(heap.only(visible), pixels[visible])
        assert rows.shape == (ROWS, len(COLUMNS)) and rows.dtype == np.float32
        assert not rows[len(visible) :].any()
        return visible, rows[: len(visible)]

    return observe


def column(rows: np.ndarray, name: str) -> np.ndarray:
    return rows[:, COLUMN[name]]


def test_a_box_behind_another_is_not_visible(camera, cubes):
    heap = cubes((6.5, 1.25, 0), (6.5, 1.25, 1), (6.5, 1.25, 2), (6.5, 1.25, 3), (4.5, 1.25, 0))
    assert visible_boxes(heap, camera.pixels(heap)).tolist() == [0, 1, 2, 3]
    assert camera.pixels(heap.only(np.array([4])))[0] > 50


def test_boxes_with_few_pixels_are_not_visible_unless_there_are_no_others(cubes):
    heap = cubes((5, 1, 0), (6, 1, 0), (4.5, 1, 0))
    assert visible_boxes(heap, np.array([SEEN, SEEN - 1, 0])).tolist() == [0]
    assert visible_boxes(heap, np.array([SEEN - 1, 0, 0])).tolist() == [1, 0, 2]


def test_features_of_upright_cubes(observed, cubes):
    numbers, rows = observed(cubes((5.0, 1.0, 0), (5.0, 1.0, 1), (6.0, 2.0, 0)))
    assert numbers.tolist() == [2, 0, 1]
    assert column(rows, "behind") == pytest.approx([0.2, 1.2, 1.2])
    assert column(rows, "y") == pytest.approx([0.75, -0.25, -0.25])
    assert column(rows, "z") == pytest.approx([0.2, 0.2, 0.6])
    for name in ("extent_x", "extent_y", "extent_z", "longest", "middle", "shortest"):
        assert column(rows, name) == pytest.approx([0.4, 0.4, 0.4])
    assert column(rows, "tilt") == pytest.approx([0, 0, 0], abs=1e-6)
    assert column(rows, "clear_above") == pytest.approx([1, 0, 1], abs=1e-6)
    assert column(rows, "clear_in_front") == pytest.approx([1, 1, 1], abs=1e-6)
    assert (column(rows, "pixels") * 1000 >= 4).all()


def test_edges_are_sorted_whichever_way_a_box_lies():
    turn = np.array([[0, 0, np.sin(np.pi / 4), np.cos(np.pi / 4)]])
    heap = Heap(np.array([[5.0, 1, 1]]), turn, np.array([[0.2, 0.6, 0.4]]), np.array([0]))
    row = features(heap, np.array([9]))[:1]
    assert row[0, COLUMN["extent_x"] : COLUMN["tilt"]].tolist() == pytest.approx(
        [0.6, 0.2, 0.4, 0.6, 0.4, 0.2]
    )


def test_a_box_half_in_front_covers_half(observed, cubes):
    numbers, rows = observed(cubes((5.0, 1.0, 0), (5.5, 1.2, 0)))
    assert numbers.tolist() == [1, 0]
    assert column(rows, "clear_in_front") == pytest.approx([1, 0.5])


def test_only_the_foremost_boxes_get_a_row(cubes):
    count = ROWS + 10
    heap = cubes(*((x, 1, 0) for x in np.linspace(4, 7, count)))
    assert visible_boxes(heap, np.full(count, 9)).tolist() == list(range(count - 1, 9, -1))
