"""The second engine: what it decides, and that no file mixes its lifts with PyBullet's."""

import sys
from unittest.mock import Mock

import numpy as np
import pytest

from unload import task
from unload.physics import bullet, mujoco
from unload.physics.local import LocalPhysics
from unload.physics.situation import Situation
from unload.physics.table import HELD_DOWN, LiftTable, TablePhysics, shared_table


@pytest.fixture
def no_pybullet(monkeypatch):
    """PyBullet as if it were not installed, and no lifts known but those that ship."""
    caches = bullet.engine_of, shared_table, bullet._pybullet
    monkeypatch.setitem(sys.modules, "pybullet", None)
    for each in caches:
        each.cache_clear()
    yield
    for each in caches:
        each.cache_clear()


@pytest.fixture(scope="module")
def hard(situations) -> list[Situation]:
    """Different situations that a table knows by no rule."""
    different = {each.key: each for each in situations if 0 < each.on_top < HELD_DOWN}
    return list(different.values())[:12]


def test_floor_and_side_walls_hold_what_they_touch():
    """A box inside the floor or a side wall is pushed out; one beside them is only lifted."""
    box = np.array([[0, 0, 0, 400_000, 400_000, 400_000]], np.int32)
    free = mujoco.simulate(Situation(box, 1, None, ()))
    beside = mujoco.simulate(Situation(box, 1, -200_000, (-200_000, 200_000)))
    assert beside == pytest.approx(free, abs=1e-3)
    for floor, sides in ((-190_000, ()), (None, (-190_000,)), (None, (190_000,))):
        assert abs(mujoco.simulate(Situation(box, 1, floor, sides)) - free) > 0.002


def test_a_free_box_loses_as_much_speed_in_a_second_as_in_bullet():
    """Written out step by step; a share of the speed, which is lost within each step."""
    box, speed, moved = np.array([[0, 0, 0, 400_000, 400_000, 400_000]], np.int32), 0.0, 0.0
    for _ in range(round(task.LIFT_TIME / mujoco.STEP)):
        speed += mujoco.STEP * (task.PICK_FORCE / task.MASS - task.GRAVITY)
        speed /= 1 - mujoco.STEP * np.log(1 - bullet.DAMPING)
        moved += mujoco.STEP * speed
    assert mujoco.simulate(Situation(box, 1, None, ())) == pytest.approx(moved, abs=1e-6)
    assert mujoco.settings()["time_step"] == mujoco.STEP and "pybullet" not in mujoco.settings()


@pytest.mark.pybullet
@pytest.mark.parametrize("beyond", [60_000, 160_000, 200_000])
def test_friction_is_that_of_pybullet(beyond):
    """A box pushes another one aside that lies on it, which rubs. Without friction, or with twice
    as much, they move by 5 mm less or more in one of these cases."""
    size = (400_000, 400_000, 400_000)
    boxes = np.array([(0, 0, 0, *size), (0, beyond, 400_000, *size)], np.int32)
    situation = Situation(boxes, 2, -200_000, ())
    expected = LocalPhysics("pybullet").simulate(situation)
    assert mujoco.simulate(situation) == pytest.approx(expected, abs=0.0015)


def test_a_lift_that_it_cannot_simulate_is_an_error(monkeypatch, tmp_path):
    """Boxes that fly off, which it says by a warning and a file in the working directory."""
    engine = pytest.importorskip("mujoco")
    step = engine.mj_step

    def diverge(model, data, nstep):
        data.qvel[:] = np.inf
        step(model, data, nstep=nstep)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(engine, "mj_step", diverge)
    with pytest.raises(FloatingPointError, match="MuJoCo cannot simulate a lift"):
        mujoco.simulate(Situation(np.array([[0, 0, 0, 400_000, 400_000, 400_000]]), 1, None, ()))


@pytest.mark.pybullet
def test_it_decides_as_pybullet_does(situations):
    light = [each for each in situations if each.on_top < HELD_DOWN]
    decided = [
        [physics.simulate(each) >= task.LIFT_THRESHOLD for each in light]
        for physics in (LocalPhysics("mujoco"), LocalPhysics("pybullet"))
    ]
    assert decided[0] == decided[1] and 10 < sum(decided[0]) < len(light)


def test_what_it_lifted_before_makes_no_difference(hard):
    physics = LocalPhysics("mujoco")
    alone = [physics.simulate(each) for each in hard]
    assert [physics.simulate(each) for each in hard[::-1]] == alone[::-1]
    assert physics._world is None, "PyBullet is not asked"


def test_without_pybullet_it_answers_what_no_table_knows(no_pybullet, hard, monkeypatch):
    assert LocalPhysics().engine == TablePhysics(shared_table()).engine == "mujoco"
    monkeypatch.setattr(mujoco, "simulate", Mock(return_value=0.123))
    assert LocalPhysics().simulate(hard[0]) == 0.123
    table = shared_table()
    known = [each for each in hard if table.find(each) is not None]
    assert known and TablePhysics(table).simulate(known[0]) != 0.123, "PyBullet's answers ship"


def test_the_lifts_that_ship_are_never_written_as_its_own(no_pybullet, hard, tmp_path):
    """They stay PyBullet's; a file holds what MuJoCo has added."""
    table = shared_table()
    shipped = len(table)
    new = Situation(hard[0].boxes + np.int32([0, 0, 0, 7, 0, 0]), hard[0].dynamic, None, ())
    TablePhysics(table, exact=True).simulate(new)
    table.save(tmp_path / "lifts.npz")
    stored = LiftTable.load(tmp_path / "lifts.npz", "mujoco")
    assert len(table) == shipped + 1 and len(stored) == 1
    assert table.find(new) == stored.find(new) == LocalPhysics().simulate(new)


@pytest.mark.parametrize("engine", bullet.ENGINES)
def test_a_file_of_one_engine_is_refused_by_the_other(hard, tmp_path, engine):
    path, table = tmp_path / "lifts.npz", LiftTable(engine)
    table.add(hard[0], 0.1)
    table.save(path)
    (other,) = {*bullet.ENGINES} - {engine}
    refused = rf'of another physics, {{"{engine}": .*; expected {{"{other}": .*Remove it'
    with pytest.raises(ValueError, match=refused):
        LiftTable.load(path, other)
    assert LiftTable.load(path, engine).find(hard[0]) == 0.1
