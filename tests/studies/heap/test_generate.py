import numpy as np
import pytest

from studies.heap.boxes import DOOR, REAR, WIDTH
from studies.heap.generate import FEWEST, HIGHEST, read_heaps, settled_heap, write_heaps
from studies.heap.rake import add_walls
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
    add_walls(world)
    bodies = [
        world.add_box(place, size, 1.0, turn)
        for place, size, turn in zip(real_heap.positions, real_heap.sizes, real_heap.orientations)
    ]
    world.step(1.0)
    heights = np.array([world.pose(body)[0][2] for body in bodies])
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
