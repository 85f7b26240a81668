"""What all three physics have in common: lifts, masses, forces, ceilings, and one's own."""

from functools import partial
from unittest.mock import Mock

import numpy as np
import pytest

from unload import ContainerEnv, Load, evaluate, picking_order, policies, task
from unload.env.vector import ContainerVectorEnv
from unload.load.substacks import build_load
from unload.physics.base import Physics
from unload.physics.bullet import World
from unload.physics.full import FullPhysics
from unload.physics.local import LocalPhysics
from unload.physics.situation import Surroundings
from unload.physics.table import FREE_LIFT, LiftTable, TablePhysics

KINDS = {"full": FullPhysics, "local": LocalPhysics, "table": TablePhysics}
KINDS["mujoco"] = partial(LocalPhysics, "mujoco")
# The same as parameters of tests.
EACH = [pytest.param("full", marks=pytest.mark.pybullet), "local", "table", "mujoco"]
ONE_BOX, TWO_BOXES = 0.46, 0.009  # m, for 20 N and 1 kg


def make(kind: str, load: Load, **kwargs) -> Physics:
    """A physics that holds ``load``."""
    physics = KINDS[kind](**kwargs)
    physics.reset(load)
    return physics


def lifts(physics: Physics, items) -> list[float]:
    return [physics.lift(int(item)) for item in items]


@pytest.mark.parametrize("kind", EACH)
def test_one_box_and_two_stacked_ones_move_as_far_as_the_appendix_says(boxes, kind):
    physics = make(kind, boxes((1.2, 0.2), (1.2, 0.6)))
    assert physics.lift(0) == pytest.approx(TWO_BOXES, abs=0.002)
    assert make(kind, boxes((1.2, 0.2), (1.2, 0.6), (1.2, 1.0))).lift(0) < 0.001
    assert physics.lift(1) == pytest.approx(ONE_BOX, rel=0.02)
    physics.remove(1)
    assert physics.present.tolist() == [True, False]
    assert physics.lift(0) == pytest.approx(ONE_BOX, rel=0.02)


@pytest.mark.parametrize("kind", EACH)
def test_free_boxes_of_a_neat_row_do_not_jam(kind):
    """They would, mostly, if the boxes had no gap between them."""
    load = build_load([[[0, 1, 1, 0]]])
    physics = make(kind, load)
    free = np.flatnonzero(~load.covered(physics.present))
    assert len(free) >= 8
    assert lifts(physics, free[:8]) == pytest.approx([ONE_BOX] * 8, rel=0.02)


@pytest.mark.parametrize("kind", EACH)
@pytest.mark.parametrize("call", ["lift", "remove"])
def test_bad_items_are_refused(boxes, kind, call):
    physics = make(kind, boxes((1.2, 0.2), (2.0, 0.2)))
    physics.remove(1)
    for item, message in ((1, "item 1 has been removed"), (2, "item is 2; .* >= 0 and <= 1")):
        with pytest.raises(ValueError, match=message):
            getattr(physics, call)(item)
    assert physics.present.tolist() == [True, False]


@pytest.mark.parametrize("kind", EACH)
def test_calls_out_of_order_are_refused(boxes, kind):
    physics, load = KINDS[kind](), boxes((1.2, 0.2))
    calls = [lambda: physics.lift(0), lambda: physics.remove(0), physics.positions]
    calls += [lambda: physics.settle(0.1)] if kind == "full" else []
    for call in calls:
        with pytest.raises(RuntimeError, match="the physics holds no load; call reset first"):
            call()
    physics.reset(load)
    if kind != "full":
        situation = physics.surroundings.situation(0)
        calls.append(lambda: physics.simulate(situation))
    physics.close()
    physics.close()
    for call in (*calls, lambda: physics.reset(load)):
        with pytest.raises(RuntimeError, match="the physics is closed; make a new one"):
            call()


@pytest.mark.pybullet
def test_an_interrupted_lift_leaves_nothing_in_the_way(situations, monkeypatch):
    interrupted, fresh = LocalPhysics(), LocalPhysics()
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(World, "pull", Mock(side_effect=KeyboardInterrupt))
        interrupted.simulate(situations[0])
    for situation in situations[:3]:
        assert interrupted.simulate(situation) == fresh.simulate(situation)


@pytest.mark.pybullet
def test_a_world_that_is_cleared_gives_the_same(situations, monkeypatch):
    physics, fresh = LocalPhysics(), LocalPhysics()
    expected = [fresh.simulate(situation) for situation in situations[:10]]
    monkeypatch.setattr("unload.physics.local._MOST_BODIES", 3)
    for situation, distance in zip(situations, expected):
        assert physics.simulate(situation) == distance
        assert physics._world.bodies <= len(situation.boxes) + 6
    assert fresh._world.bodies > 30


class Half(LocalPhysics):
    """Lifts every box by half a metre."""

    def simulate(self, situation) -> float:
        return 0.5


def weighed(load: Load, *masses: float, **fields) -> Load:
    return Load(load.positions, load.sizes, masses=masses or None, **fields)


@pytest.mark.parametrize("kind", EACH)
def test_a_box_moves_by_its_mass_and_the_force(boxes, kind):
    """Up to 20 N per kg; a weight that no force holds stays."""
    load = weighed(boxes((0.3, 0.2), (0.8, 0.2), (1.3, 0.2)), 0.5, 1.25, 5)
    for force in (20, 60, "auto"):
        physics = make(kind, load, force=force)
        limit = np.inf if force == "auto" else force
        upwards = np.minimum(20, limit / load.masses) - task.GRAVITY
        newton = np.maximum(0, upwards) * task.LIFT_TIME**2 / 2
        found = [physics.lift(item) for item in range(3)]
        assert found == pytest.approx(newton, rel=0.02, abs=0.002)
        assert found[0] == pytest.approx(FREE_LIFT, abs=0.004)
    assert found[2] == pytest.approx(FREE_LIFT, abs=0.004)
    assert make(kind, load).lift(2) == pytest.approx(0, abs=0.002)


def test_mass_and_force_stand_in_the_key_where_they_are_not_those_of_the_task(boxes):
    load = boxes((0.3, 0.2), (0.3, 0.6))
    usual = Surroundings(load, np.ones(2, bool)).situation(0)
    keys = {usual.key}
    assert usual.pull == () and (usual.force, usual.masses) == (20, [1, 1])
    for masses, force in (((), 30), ((2, 1), 20), ((2, 1), 40), ((1, 2), 20), ((), 10)):
        situation = Surroundings(weighed(load, *masses), np.ones(2, bool), force).situation(0)
        keys.add(situation.key)
        assert situation.masses == [*(masses or (1, 1))]
        assert situation.force == min(force, 20 * situation.masses[0])
    assert len(keys) == 5, "30 N pull a box of 1 kg with 20 N"


def test_a_table_asks_no_rule_about_other_masses(boxes):
    """A heavy box lifts three light ones, which at 1 kg hold it down."""
    tower = boxes((0.3, 0.2), (0.3, 0.6), (0.3, 1.0), (0.3, 1.4))
    for masses, lifted in (((), False), ((25, 0.2, 0.2, 0.2), True)):
        physics = make("table", weighed(tower, *masses), force="auto")
        assert (physics.lift(0) > 0.2) == lifted
        assert len(physics.table) == lifted
        assert physics.lift(0) == make("local", physics.load, force="auto").lift(0) or not lifted


@pytest.mark.parametrize("kind", EACH)
def test_under_a_low_ceiling_no_box_is_lifted(boxes, kind):
    load = boxes((0.3, 0.2), (0.8, 0.2), (0.8, 0.6))
    for height, lifted in ((1.01, [True, False, True]), (0.99, [True, False, False])):
        physics = make(kind, weighed(load, ceiling=height))
        assert [physics.lift(item) >= 0.2 for item in range(3)] == lifted
    assert physics.lift(2) == 0


def test_arrays_know_ceilings_and_refuse_masses(boxes):
    low = weighed(boxes((0.3, 0.2), (0.8, 0.2), (0.8, 0.6)), ceiling=0.99)
    for envs in (ContainerVectorEnv(1), ContainerEnv("table")):
        envs.reset(seed=0, options={"load": low})
        assert envs.liftable().ravel()[:3].sum() == 1
    with pytest.raises(ValueError, match="holds a box of 2.0 kg; expected 1.0 kg each in arrays"):
        ContainerVectorEnv(1).reset(options={"load": weighed(low, 1, 2, 1)})
    for force in (9, 16, "auto"):  # of which the first lifts nothing: a box weighs 9.8 N
        table = ContainerVectorEnv(2, physics=TablePhysics(LiftTable(), force))
        table.reset(seed=0, options={"load": low})
        single = ContainerEnv(LocalPhysics(force=force))
        single.reset(seed=0, options={"load": low})
        assert table.liftable()[1].tolist() == single.liftable().tolist()


def test_a_physics_of_ones_own_stays_open(boxes):
    load, own = boxes((0.3, 0.2), (0.3, 0.6)), Half()
    for _ in range(2):
        env = ContainerEnv(own)
        env.reset(options={"load": load})
        assert env.step(1)[4]["distance"] == 0.5
        env.close()
        table = evaluate(policies.random, 2, physics=own, stack=lambda rng: load, max_picks=2)
        assert (table["success_rate"] == 1).all()
        assert (picking_order(load, physics=own)["distance"] == 0.5).all()
    envs = ContainerVectorEnv(2, physics=own)  # which no table answers for
    envs.reset(options={"load": load})
    assert envs.step(np.array([1, 0]))[4]["distance"].tolist() == [0.5, 0.5]
    envs.close()
    assert not own._closed
