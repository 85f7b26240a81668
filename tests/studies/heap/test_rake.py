import numpy as np
import pytest

from studies.heap.rake import CAME, FALL, FORCE, PHYSICS, REACH, add_walls, drag, near_boxes
from unload import task
from unload.physics.bullet import World


@pytest.fixture
def dragged():
    """``dragged(mass)``: how far a box alone is dragged, and where it has slid to 0.5 s later."""
    world = World()

    def drag_one(mass: float) -> tuple[float, float]:
        world.clear()
        add_walls(world)
        box = world.add_box((5, 1, 0.2), (0.4, 0.4, 0.4), mass)
        moved = drag(world, box, mass)
        world.step(0.5)
        return moved, world.pose(box)[0][0] - 5

    yield drag_one
    world.close()


def test_a_dragged_box_stops_behind_its_reach(dragged):
    moved, slid = dragged(mass=1.0)
    assert REACH <= moved < REACH + 0.01
    assert slid == pytest.approx(moved, abs=0.002)


def test_a_drag_weaker_than_friction_moves_nothing(dragged):
    """Friction of 0.5 on both sides holds a quarter of the weight."""
    heaviest = FORCE / (0.25 * task.GRAVITY)
    assert dragged(1.2 * heaviest)[0] < 0.002
    assert 0.02 < dragged(0.8 * heaviest)[0] < REACH


@pytest.mark.parametrize("physics", PHYSICS)
def test_a_free_box_comes_alone(cubes, make_rake, physics):
    outcome = make_rake(physics).pick(cubes((5, 1, 0)), 0)
    assert outcome.came and outcome.moved == pytest.approx(REACH, abs=0.02)
    assert outcome.unloaded.tolist() == [True] and len(outcome.heap) == 0


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
    assert outcome.left.tolist() == np.flatnonzero(~outcome.unloaded).tolist()
    assert outcome.heap.positions[-1] == pytest.approx(heap.positions[-1], abs=0.005)


def test_too_heavy_a_row_does_not_come(cubes, make_rake):
    row = cubes(*((4.3 + 0.405 * k, 1, level) for k in range(5) for level in range(4)))
    outcome = make_rake(friction=1.0, mass=3.0).pick(row, 0)
    assert not outcome.came and outcome.moved < CAME
    assert not outcome.unloaded[0]


def test_a_box_that_loses_its_support_falls_but_the_dragged_one_does_not_count(cubes, make_rake):
    tower = cubes((5, 1, 0), (5, 1, 1), (5, 1, 2), (4.55, 1, 0))
    high = make_rake().pick(tower, 2)
    assert high.came and not high.fallen.any(), "the dragged box dropped by 0.8 m"
    tower = cubes((5, 1, 0), (5, 1, 1), (5, 1, 2), (5, 1, 3))
    lowest = make_rake(friction=0.05).pick(tower, 0)
    assert lowest.fallen.tolist() == [False, False, True, True]
    on_floor = 0.2  # m, a cube's centre
    assert (tower.positions[lowest.fallen, 2] - on_floor > FALL).all()


@pytest.mark.parametrize("physics", PHYSICS)
def test_a_pick_depends_on_nothing_but_the_heap(pile, make_rake, physics):
    used, fresh = make_rake(physics), make_rake(physics)
    first = used.pick(pile, 3)
    used.pick(pile.only(np.arange(5)), 1)
    for other in (used.pick(pile, 3), fresh.pick(pile, 3)):
        assert other.heap.positions.tobytes() == first.heap.positions.tobytes()
        assert other.heap.orientations.tobytes() == first.heap.orientations.tobytes()
        assert other.unloaded.tolist() == first.unloaded.tolist()


def test_near_boxes_are_those_around_the_drag(cubes):
    heap = cubes((5, 1, 0), (5.9, 1, 0), (4.25, 1, 0), (5, 1.45, 0), (6.65, 1, 0), (4.25, 2.3, 0))
    moving, fixed = near_boxes(heap, 0)
    assert moving.tolist() == [True, True, True, True, True, False]
    assert not (moving & fixed).any()


def test_near_leaves_far_boxes_exactly_where_they_are(cubes, make_rake):
    heap = cubes((6, 0.3, 0), (4.3, 2.2, 0), (4.3, 2.2, 1))
    outcome = make_rake("near").pick(heap, 0)
    assert outcome.heap.positions.tolist() == heap.positions[1:].tolist()
