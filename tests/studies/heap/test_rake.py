"""Heaps, how they are made, and what a pick does to them."""

import numpy as np
import pytest

from studies.heap import recording
from studies.heap.boxes import DOOR, FARTHEST_EDGE, REAR, WIDTH, Heap
from studies.heap.generate import _accepted, stored_heaps, write_heaps
from studies.heap.rake import PHYSICS, Rake
from studies.results import code_of
from unload import task

pytestmark = pytest.mark.pybullet


@pytest.mark.parametrize(
    ("places", "unloaded"),
    [
        (((4.5, 1, 0), (4.91, 1, 0), (5.32, 1, 0), (5.32, 2, 0)), [True, True, True, False]),
        (((4.5, 1, 0), (6, 1, 0), (6.5, 2, 0)), [True, False, False]),  # too far behind
        # The third reaches to 7.39 m; the second is pushed to 7.28 m, past the edge at 7.2 m.
        (((6.0, 1, 0), (6.5, 1, 0), (7.19, 2, 0)), [True, True, False]),
    ],
)
def test_boxes_before_the_dragged_one_are_pushed_over_the_edge(cubes, places, unloaded):
    heap = cubes(*places)
    outcome = Rake("coarse").pick(heap, 0)
    assert outcome.unloaded.tolist() == unloaded
    assert len(outcome.heap) == unloaded.count(False)
    assert outcome.heap.positions[-1] == pytest.approx(heap.positions[-1], abs=0.005)


@pytest.mark.parametrize(("mass", "moved", "came"), [(12.0, 0.7, True), (18.0, 0.44, False)])
def test_a_box_comes_if_it_has_moved_by_nine_tenths_of_the_reach(
    cubes, monkeypatch, mass, moved, came
):
    """The heavier, the less far within a second; it is not past the edge in either case."""
    monkeypatch.setattr(task, "MASS", mass)
    outcome = Rake("coarse").pick(cubes((4.5, 1, 0), (6, 2, 0)), 0)
    assert outcome.moved == pytest.approx(moved, abs=0.03)
    assert outcome.came == came and outcome.unloaded.tolist() == [came, False]


def test_a_box_that_loses_its_support_falls_but_not_the_dragged_one(cubes, set_friction):
    tower = cubes((5, 1, 0), (5, 1, 1), (5, 1, 2), (4.55, 1, 0))
    high = Rake("coarse").pick(tower, 2)
    assert high.came and not high.fallen.any(), "the dragged box dropped by 0.8 m"
    set_friction(0.05)
    tower = cubes((5, 1, 0), (5, 1, 1), (5, 1, 2), (5, 1, 3))
    assert Rake("coarse").pick(tower, 0).fallen.tolist() == [False, False, True, True]


@pytest.mark.parametrize("physics", PHYSICS)
def test_a_pick_depends_on_nothing_but_the_heap(pile, physics):
    used, fresh = Rake(physics), Rake(physics)
    first = used.pick(pile, 3)
    used.pick(pile.only(np.arange(5)), 1)
    for other in (used.pick(pile, 3), fresh.pick(pile, 3)):
        assert code_of(other.heap) == code_of(first.heap)
        assert other.unloaded.tolist() == first.unloaded.tolist()


def test_the_edge_is_at_the_front_but_does_not_give_way_beyond_the_door(cubes):
    assert cubes((5, 1, 0), (6, 1, 0)).edge() == pytest.approx(6.2)
    assert cubes((5, 1, 0), (7.1, 1, 0)).edge() == FARTHEST_EDGE
    assert cubes((5, 1, 0)).only(np.array([], int)).edge() == REAR
    assert DOOR < FARTHEST_EDGE < 7.3


@pytest.fixture(scope="module")
def real_heap() -> Heap:
    """A new heap; in the last round of settling boxes were still leaving."""
    return Heap(**recording._new_heap(recording.SEEDS["train"], 60))


def test_the_shipped_heaps_are_what_the_generator_makes(real_heap):
    assert code_of(real_heap) == code_of(stored_heaps("train")[60])


def test_heaps_that_are_small_or_stick_out_or_move_are_rejected(real_heap):
    assert _accepted(real_heap.only(np.arange(80)), fastest=0.1)
    assert not _accepted(real_heap.only(np.arange(79)), fastest=0.1)
    assert not _accepted(real_heap, fastest=0.11)
    for axis, place in ((0, 3.9), (0, 7.1), (1, -0.1), (1, WIDTH + 0.1), (2, -0.1), (2, 2.45)):
        positions = real_heap.positions.copy()
        positions[0, axis] = place
        moved = Heap(positions, *list(vars(real_heap).values())[1:])
        assert not _accepted(moved, fastest=0)


def test_stored_heaps_are_the_same_to_the_bit(tmp_path, real_heap):
    path = tmp_path / "heaps.npz"
    part = real_heap.only(np.arange(7))
    write_heaps(path, {"train": [real_heap, part], "test": [part]})
    first, second = stored_heaps("train", path)
    (third,) = stored_heaps("test", path)
    for read, heap in ((first, real_heap), (second, part), (third, part)):
        assert code_of(read) == code_of(heap) and len(read) == len(heap)
        assert not any(array.flags.writeable for array in vars(read).values())
