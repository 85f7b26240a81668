import numpy as np
import pytest

from studies.heap.rake import FALL, PHYSICS


@pytest.mark.parametrize(
    ("places", "unloaded"),
    [
        (((4.5, 1, 0), (4.91, 1, 0), (5.32, 1, 0), (5.32, 2, 0)), [True, True, True, False]),
        (((4.5, 1, 0), (6, 1, 0), (6.5, 2, 0)), [True, False, False]),  # too far behind
        # The third reaches to 7.39 m; the second is pushed to 7.28 m, past the edge at 7.2 m.
        (((6.0, 1, 0), (6.5, 1, 0), (7.19, 2, 0)), [True, True, False]),
    ],
)
def test_boxes_before_the_dragged_one_are_pushed_over_the_edge(cubes, make_rake, places, unloaded):
    heap = cubes(*places)
    outcome = make_rake().pick(heap, 0)
    assert outcome.unloaded.tolist() == unloaded
    assert len(outcome.heap) == unloaded.count(False)
    assert outcome.heap.positions[-1] == pytest.approx(heap.positions[-1], abs=0.005)


@pytest.mark.parametrize(("mass", "moved", "came"), [(12.0, 0.7, True), (18.0, 0.44, False)])
def test_a_box_comes_if_it_has_moved_by_nine_tenths_of_the_reach(
    cubes, make_rake, mass, moved, came
):
    """The heavier, the less far within a second; it is not past the edge in either case."""
    outcome = make_rake(mass=mass).pick(cubes((4.5, 1, 0), (6, 2, 0)), 0)
    assert outcome.moved == pytest.approx(moved, abs=0.03)
    assert outcome.came == came and outcome.unloaded.tolist() == [came, False]


def test_a_box_that_loses_its_support_falls(cubes, make_rake, set_friction):
    set_friction(0.05)
    tower = cubes((5, 1, 0), (5, 1, 1), (5, 1, 2), (5, 1, 3))
    lowest = make_rake().pick(tower, 0)
    assert lowest.fallen.tolist() == [False, False, True, True]
    on_floor = 0.2  # m, a cube's centre
    assert (tower.positions[lowest.fallen, 2] - on_floor > FALL).all()


def test_a_dragged_box_does_not_count_as_fallen(cubes, make_rake):
    tower = cubes((5, 1, 0), (5, 1, 1), (5, 1, 2), (4.55, 1, 0))
    high = make_rake().pick(tower, 2)
    assert high.came and not high.fallen.any(), "the dragged box dropped by 0.8 m"


@pytest.mark.parametrize("physics", PHYSICS)
def test_a_pick_depends_on_nothing_but_the_heap(pile, make_rake, physics):
    used, fresh = make_rake(physics), make_rake(physics)
    first = used.pick(pile, 3)
    used.pick(pile.only(np.arange(5)), 1)
    for other in (used.pick(pile, 3), fresh.pick(pile, 3)):
        assert other.heap.positions.tobytes() == first.heap.positions.tobytes()
        assert other.heap.orientations.tobytes() == first.heap.orientations.tobytes()
        assert other.unloaded.tolist() == first.unloaded.tolist()
