import numpy as np
import pytest

from studies.heap.boxes import DOOR, REAR, WIDTH, Heap
from studies.heap.generate import (
    FASTEST,
    FEWEST,
    HIGHEST,
    _accepted,
    read_heaps,
    settled_heap,
    write_heaps,
)
from studies.heap.rake import fill
from unload.physics.bullet import World


def test_a_heap_is_disordered_and_fits_in(real_heap):
    assert FEWEST <= len(real_heap) <= 130
    low = real_heap.positions - real_heap.extents() / 2
    high = real_heap.positions + real_heap.extents() / 2
    assert low.min(axis=0) == pytest.approx([REAR, 0, 0], abs=0.02)
    assert (real_heap.positions[:, 0] < DOOR).all()
    assert high[:, 1].max() < WIDTH + 0.02 and high[:, 2].max() <= HIGHEST
    assert (real_heap.tilts() > np.radians(10)).mean() > 0.3


def test_a_heap_is_at_rest(real_heap):
    """Two seconds later no box has dropped; some have crept, since friction is low."""
    world = World()
    bodies = fill(world, real_heap, 1.0)
    world.step(1.0)
    heights = np.array([world.pose(body)[0][2] for body in bodies.values()])
    world.close()
    assert (real_heap.positions[:, 2] - heights).max() < 0.25


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


def test_a_heap_that_is_never_accepted_is_an_error(monkeypatch):
    monkeypatch.setattr("studies.heap.generate.BOXES", 10)  # fewer than FEWEST
    monkeypatch.setattr("studies.heap.generate.TRIES", 2)
    with pytest.raises(RuntimeError, match="2 heaps were rejected"):
        settled_heap(np.random.default_rng(0))


def moved(heap: Heap, box: int, place: tuple[float, float, float]) -> Heap:
    """A heap with one box in another place."""
    positions = heap.positions.copy()
    positions[box] = place
    return Heap(positions, heap.orientations, heap.sizes, heap.packages)


def test_a_heap_is_accepted_if_it_is_large_low_inside_and_at_rest(real_heap):
    assert _accepted(real_heap, FASTEST)
    assert not _accepted(real_heap, 1.01 * FASTEST)
    assert _accepted(real_heap.only(np.arange(FEWEST)), 0)
    assert not _accepted(real_heap.only(np.arange(FEWEST - 1)), 0)
    for place in (
        (REAR - 0.01, 1, 1), (DOOR + 0.01, 1, 1), (5, -0.01, 1), (5, WIDTH + 0.01, 1), (5, 1, -0.01)
    ):  # fmt: skip
        assert not _accepted(moved(real_heap, 0, place), 0)
    half = real_heap.extents()[0, 2] / 2
    assert _accepted(moved(real_heap, 0, (5, 1, HIGHEST - half - 0.001)), 0)
    assert not _accepted(moved(real_heap, 0, (5, 1, HIGHEST - half + 0.001)), 0), "its top"
