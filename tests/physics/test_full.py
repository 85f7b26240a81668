"""Lifts in a simulation of every box."""

import numpy as np
import pytest

from tests.physics.test_local import ONE_BOX, lifts, make
from unload import Load, task
from unload.load.substacks import build_load
from unload.physics.bullet import GAP, World
from unload.physics.full import FullPhysics

pytestmark = pytest.mark.pybullet

# Two boxes side by side, one across both, and the lift of a support: it fails, and tilts
# the box above. The lift of the upper box succeeds.
BRIDGE = ((1.0, 0.2), (1.4, 0.2), (1.2, 0.6))
# One row of a wall each, because all boxes are simulated.
ROW, OTHER_ROW = build_load([[[1, 0, 1, 1]]]), build_load([[[2, 2, 2, 2]]])


@pytest.mark.parametrize(("after_pick", "restored"), [("restore", True), ("keep", False)], ids=str)
@pytest.mark.parametrize("item", [0, 2])
def test_what_a_full_lift_leaves_behind(boxes, after_pick, item, restored):
    load = boxes(*BRIDGE)
    physics = make("full", load, after_pick=after_pick)
    assert (physics.lift(item) >= task.LIFT_THRESHOLD) == (item == 2)
    moved = np.abs(physics.positions() - load.positions).max()
    assert moved == 0 if restored else moved > 0.005


def test_boxes_are_as_large_as_in_a_situation(monkeypatch):
    """In whole micrometres, and less the gap between them."""
    sizes, add_box = [], World.add_box

    def noted(world, position, size, mass):
        sizes.append(size)
        return add_box(world, position, size, mass)

    monkeypatch.setattr(World, "add_box", noted)
    make("full", Load([[1, 1, 0.2]], [[0.4000004, 0.4, 0.4]]))
    assert sizes[-1] == pytest.approx([0.4 - GAP, 0.4 - GAP, 0.4], abs=1e-9)


@pytest.mark.parametrize("call", ["lift", "remove"])
def test_bad_items_are_refused(boxes, call):
    physics = make("full", boxes((1.2, 0.2), (2.0, 0.2)))
    physics.remove(1)
    for item, message in ((1, "item 1 has been removed"), (2, "item is 2; .* >= 0 and <= 1")):
        with pytest.raises(ValueError, match=message):
            getattr(physics, call)(item)
    assert physics.present.tolist() == [True, False]


def test_nothing_is_asked_of_a_container_that_is_not_filled(boxes):
    physics, load = FullPhysics(), boxes((1.2, 0.2))
    calls = [lambda: physics.lift(0), lambda: physics.remove(0), physics.positions]
    calls += [lambda: physics.settle(0.1)]
    for _ in range(2):
        for call in calls:
            with pytest.raises(RuntimeError, match="the physics holds no load; call reset first"):
                call()
        physics.reset(load)
        assert (physics.positions() == load.positions).all()
        physics.close()
        physics.close()


def test_a_restored_full_world_repeats_its_answers():
    physics = make("full", ROW)
    items = range(0, len(ROW), 6)
    first = lifts(physics, items)
    assert lifts(physics, items) == pytest.approx(first, abs=1e-6), "no contact is left over"


def test_settling_moves_boxes_a_little_and_restore_keeps_to_it():
    """PyBullet's external force does not wake a sleeping body: no body may fall asleep."""
    physics = make("full", ROW)
    physics.settle(5.0)
    settled = physics.positions()
    drift = np.abs(settled - ROW.positions)
    assert 0 < drift.max() < 0.01
    free = np.flatnonzero(~ROW.covered(physics.present))[0]
    assert physics.lift(free) == pytest.approx(ONE_BOX, rel=0.02)
    assert (physics.positions() == settled).all()


@pytest.mark.parametrize("container", [task.CONTAINER, (6.0, 2.2, 2.7)])
def test_the_container_has_a_floor_and_three_walls(boxes, container):
    """Rays from its inside, also close to its corners, meet them where the container ends."""
    load = boxes((0.4, 0.2))
    client = make("full", Load(load.positions, load.sizes, container=container))._world.client
    low, high = np.array([0.01, 0.01, 0.01]), np.array(container) - 0.01
    for start in (low, high, (low + high) / 2):
        for axis, end in ((0, 0), (1, 0), (1, container[1]), (2, 0)):
            target = start.copy()
            target[axis] = 3 * (end or -1)
            hit = client.rayTest(start, target)[0][3]
            assert hit == pytest.approx([*start[:axis], end, *start[axis + 1 :]], abs=1e-3)
        assert client.rayTest(start, (9, *start[1:]))[0][0] == -1


@pytest.mark.parametrize("after_pick", ["restore", "keep"])
def test_a_world_that_is_filled_again_is_a_new_one(after_pick):
    again, fresh = (make("full", load, after_pick=after_pick) for load in (OTHER_ROW, ROW))
    lifts(again, range(0, len(OTHER_ROW), 4))
    again.remove(int(np.argmax(OTHER_ROW.positions[:, 2])))
    again.reset(ROW)
    assert again.present.all() and (again.positions() == ROW.positions).all()
    items = range(0, len(ROW), 6)
    assert lifts(again, items) == lifts(fresh, items)
