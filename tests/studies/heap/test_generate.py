import numpy as np
import pytest

from studies.heap.boxes import DOOR, REAR, WIDTH
from studies.heap.generate import (
    FEWEST,
    HIGHEST,
    read_heaps,
    write_heaps,
)


def test_a_heap_is_disordered_and_fits_in(real_heap):
    assert FEWEST <= len(real_heap) <= 130
    low = real_heap.positions - real_heap.extents() / 2
    high = real_heap.positions + real_heap.extents() / 2
    assert low.min(axis=0) == pytest.approx([REAR, 0, 0], abs=0.02)
    assert (real_heap.positions[:, 0] < DOOR).all()
    assert high[:, 1].max() < WIDTH + 0.02 and high[:, 2].max() <= HIGHEST
    assert (real_heap.tilts() > np.radians(10)).mean() > 0.3


def test_stored_heaps_are_the_same_to_the_bit(tmp_path, real_heap):
    path = tmp_path / "heaps.npz"
    part = real_heap.only(np.arange(7))
    write_heaps(path, {"train": [real_heap, part], "test": [part]})
    first, second = read_heaps("train", path)
    (third,) = read_heaps("test", path)
    for read, heap in ((first, real_heap), (second, part), (third, part)):
        assert read.positions.tobytes() == heap.positions.tobytes()
        assert read.orientations.tobytes() == heap.orientations.tobytes()
        assert read.sizes.tobytes() == heap.sizes.tobytes()
        assert read.packages.tolist() == heap.packages.tolist()
