"""A physics by its name or of one's own; other masses, forces and ceilings in all of them."""

import numpy as np
import pytest

from tests.physics.kinds import EACH, make
from unload import ContainerEnv, Load, evaluate, policies
from unload.env.vector import ContainerVectorEnv
from unload.physics.local import LocalPhysics
from unload.physics.situation import Surroundings
from unload.physics.table import FREE_LIFT, LiftTable, TablePhysics, free_lift


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
        wanted = [free_lift(min(20 * mass, limit), mass) for mass in load.masses]
        found = [physics.lift(item) for item in range(3)]
        assert found == pytest.approx(wanted, abs=0.004)
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
    with pytest.raises(ValueError, match="physics.force is 10.0; expected >= 20.0 in arrays"):
        ContainerVectorEnv(1, physics=TablePhysics(LiftTable(), 10))
    ContainerVectorEnv(1, physics=TablePhysics(LiftTable(), "auto"))


def test_a_file_says_nothing_of_the_pull_of_the_task(boxes, tmp_path):
    """So that it has the bytes that it had before there were others."""
    load, table = boxes((0.3, 0.2), (0.3, 0.6)), LiftTable()
    path, pulls = tmp_path / "lifts.npz", [(), (20_000, 1000, 2000)]
    for masses, pull, written in (((), pulls[0], False), ((1, 2), pulls[1], True)):
        situation = Surroundings(weighed(load, *masses), np.ones(2, bool)).situation(0)
        assert situation.pull == pull
        table.add(situation, 0.1)
        table.save(path)
        with np.load(path) as arrays:
            assert ("pull" in str(arrays["samples"])) == written
    assert [*LiftTable.load(path).samples] == [*table.samples]
    assert {tuple(each.pull) for each in LiftTable.load(path).samples.values()} == {*pulls}


def test_a_physics_of_ones_own_stays_open(boxes):
    load, own = boxes((0.3, 0.2), (0.3, 0.6)), Half()
    for _ in range(2):
        env = ContainerEnv(own)
        env.reset(options={"load": load})
        assert env.step(1)[4]["distance"] == 0.5
        env.close()
        table = evaluate(policies.random, 2, physics=own, stack=lambda rng: load, max_picks=2)
        assert (table["success_rate"] == 1).all()
    table = TablePhysics(LiftTable())
    envs = ContainerVectorEnv(1, physics=table)
    envs.reset(options={"load": load})
    envs.step(np.array([np.argmin(envs.liftable())]))
    envs.close()
    assert len(table.table) == 1 and not table._closed
    with pytest.raises(ValueError, match="expected one of 'table', 'a TablePhysics'"):
        ContainerVectorEnv(1, physics=own)
