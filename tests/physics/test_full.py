"""Lifts in a simulation of every box."""

import time
from collections.abc import Callable
from statistics import median

import numpy as np
import pybullet
import pytest

from tests.physics.kinds import ONE_BOX
from unload import task
from unload.load.boxes import Load
from unload.load.substacks import build_load, stack_load
from unload.physics.base import Physics
from unload.physics.bullet import World
from unload.physics.full import DEPOT, FullPhysics
from unload.physics.situation import Surroundings


def lifts(physics: Physics, items) -> list[float]:
    return [physics.lift(int(item)) for item in items]


def test_boxes_of_a_full_world_at_rest_for_long_still_lift(make, small_load):
    physics = make("full", small_load)
    top = int(np.argmax(small_load.positions[:, 2]))
    physics.settle(3.0)
    assert physics.lift(top) == pytest.approx(ONE_BOX, rel=0.02)


# --- effects of a lift --------------------------------------------------------------

# Two boxes side by side, one across both, and the lift of a support: it fails, and tilts
# the box above. The lift of the upper box succeeds.
BRIDGE = ((1.0, 0.2), (1.4, 0.2), (1.2, 0.6))


@pytest.mark.parametrize(
    ("after_pick", "item", "restored"),
    [
        ("restore", 0, True),
        ("restore", 2, True),
        ("restore_failure", 0, True),
        ("restore_failure", 2, False),
        ("keep", 0, False),
        ("keep", 2, False),
    ],
)
def test_what_a_full_lift_leaves_behind(make, boxes, after_pick, item, restored):
    load = boxes(*BRIDGE)
    physics = make("full", load, after_pick=after_pick)
    assert (physics.lift(item) >= task.LIFT_THRESHOLD) == (item == 2)
    moved = np.abs(physics.positions() - load.positions).max()
    assert moved == 0 if restored else moved > 0.005
    assert physics.exact == (after_pick == "restore")


def test_a_restored_full_world_repeats_its_answers(make, small_load):
    physics = make("full", small_load)
    items = range(0, len(small_load), 15)
    first = lifts(physics, items)
    assert lifts(physics, items) == pytest.approx(first, abs=0.002)


def test_settling_moves_boxes_a_little_and_restore_keeps_to_it(make, small_load):
    physics = make("full", small_load)
    physics.settle(0.5)
    settled = physics.positions()
    drift = np.abs(settled - small_load.positions)
    assert 0 < drift.max() < 0.01
    physics.lift(0)
    assert (physics.positions() == settled).all()


def test_the_ways_to_simulate_a_full_world_lift_alike(make, rng):
    """Rigid bodies, which only ``"keep"`` uses, and multibodies."""
    load = stack_load(rng, walls=1)
    around = Surroundings(load, np.ones(len(load), dtype=bool))
    for item in np.argsort([len(around.on_top(item)) for item in range(len(load))])[::20]:
        kept, restored = (make("full", load, after_pick=how) for how in ("keep", "restore"))
        assert kept.lift(item) == pytest.approx(restored.lift(item), abs=0.005)


@pytest.mark.parametrize("after_pick", ["restore", "restore_failure", "keep"])
def test_an_interrupted_lift_moves_no_box(make, boxes, after_pick, monkeypatch):
    load = boxes(*BRIDGE)
    physics, pull = make("full", load, after_pick=after_pick), World.pull

    def interrupted(world, body):
        pull(world, body)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(World, "pull", interrupted)
        physics.lift(0)
    assert physics.lift(0) == pytest.approx(make("full", load).lift(0), abs=0.002)


# --- reset --------------------------------------------------------------------------


@pytest.mark.parametrize("after_pick", ["restore", "keep"])
def test_reused_bodies_lift_as_fresh_ones(make, rng, after_pick):
    first, second = (stack_load(rng, walls=1) for _ in range(2))
    reused = make("full", first, after_pick=after_pick)
    items = range(0, min(len(first), len(second)), 12)
    lifts(reused, items)
    top = int(np.argmax(first.positions[:, 2]))
    reused.remove(top)
    reused.reset(second)
    fresh = make("full", second, after_pick=after_pick)
    assert reused.present.all()
    assert (reused.positions() == second.positions).all()
    assert lifts(reused, items) == pytest.approx(lifts(fresh, items), abs=0.003)


@pytest.mark.parametrize("after_pick", ["restore", "keep"])
def test_boxes_stay_in_place_after_a_reset(make, rng, after_pick):
    """Contacts of the old load, if Bullet kept them, would fling boxes about."""
    physics = make("full", stack_load(rng, walls=1), after_pick=after_pick)
    for _ in range(10):
        load = stack_load(rng, walls=1)
        physics.reset(load)
        physics.settle(0.1)
        assert np.abs(physics.positions() - load.positions).max() < 0.006


def test_spare_bodies_stay_out_of_the_container(make):
    many = build_load(np.zeros((1, 3, 4), dtype=int))
    few = build_load([[[2] * 4, [2] * 4, [0] * 4]])  # of the same sizes, and others
    physics = make("full", many)
    physics.reset(few)
    physics.settle(1.0)
    made = [body for bodies in physics._bodies_of_size.values() for body in bodies]
    heights = [physics._world.pose(body)[0][2] for body in made if body not in physics._bodies]
    assert len(heights) >= len(many) - len(few)
    assert max(heights) < DEPOT + 2 and min(heights) > DEPOT


def test_reset_is_ten_times_cheaper_than_building_anew():
    """A whole load of 12 walls. CPU time, so that other programs count less."""
    rng = np.random.default_rng(0)
    loads = [stack_load(rng) for _ in range(6)]

    def cpu_time(action: Callable, *args) -> float:
        start = time.process_time()
        action(*args)
        return time.process_time() - start

    def build(load: Load) -> None:
        physics = FullPhysics()
        physics.reset(load)
        physics.close()

    building = median(cpu_time(build, load) for load in loads)
    physics = FullPhysics()
    for load in loads:  # until there are bodies enough for each of them
        physics.reset(load)
    resetting = median(cpu_time(physics.reset, load) for load in loads * 3)
    physics.close()
    print(f"\nbuild {1e3 * building:.0f} ms, reset {1e3 * resetting:.1f} ms")
    assert building >= 10 * resetting


def test_boxes_of_ever_new_sizes_do_not_pile_up():
    """Spare boxes are simulated, too: with each of them a step takes longer."""
    rng = np.random.default_rng(0)
    physics, bodies = FullPhysics(), []
    for _ in range(20):
        load = stack_load(rng, walls=1)
        sizes = load.sizes * rng.uniform(0.9, 1, load.sizes.shape)
        physics.reset(Load(load.positions, sizes, load.packages, load.walls))
        bodies.append(pybullet.getNumBodies(physicsClientId=physics._world._client))
        assert bodies[-1] < 2 * len(load)
    physics.lift(int(np.argmax(load.positions[:, 2])))
    physics.close()


def test_boxes_of_the_papers_sizes_are_kept(small_load):
    """A new world would cost more than to move the boxes, and change lifts by their history."""
    physics, rng = FullPhysics(), np.random.default_rng(0)
    physics.reset(stack_load(rng))
    world = physics._world
    for _ in range(5):
        physics.reset(stack_load(rng))
    assert physics._world is world
    physics.close()


@pytest.mark.parametrize("seconds", [-1.0, float("nan")])
def test_settle_refuses(make, boxes, seconds):
    with pytest.raises(ValueError, match="seconds is"):
        make("full", boxes((1.2, 0.2))).settle(seconds)
