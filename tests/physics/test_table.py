"""Local physics with a memory."""

from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import numpy as np
import pytest

from unload import task
from unload.load.substacks import stack_load
from unload.physics import table
from unload.physics.bullet import World
from unload.physics.lift_table import LiftTable
from unload.physics.local import LocalPhysics
from unload.physics.situation import Surroundings
from unload.physics.table import HELD_DOWN, LIFTS_FILE, TablePhysics


@pytest.fixture(scope="module")
def known(situations):
    """Situations with at most two boxes on top, and their distances in ``LocalPhysics``."""
    local = LocalPhysics()
    light = [each for each in situations if each.on_top < HELD_DOWN]
    yield [(situation, local.simulate(situation)) for situation in light]
    local.close()


def test_table_equals_local_exactly(make, rng):
    load = stack_load(rng, walls=2)
    local, table = make("local", load), make("table", load)
    for item in rng.permutation(len(load)):
        distance = local.lift(item)
        if local.surroundings.situation(item).on_top < HELD_DOWN:
            assert table.lift(item) == table.lift(item) == distance
        else:  # not simulated, because never lifted
            assert table.lift(item) == 0 and distance < 0.02
        if distance >= task.LIFT_THRESHOLD:
            local.remove(item)
            table.remove(item)
    assert (~local.present).sum() > 20


def test_a_situation_is_simulated_once(known, monkeypatch):
    first, second, fresh = TablePhysics(), TablePhysics(), TablePhysics()
    second.table = first.table
    assert [first.simulate(situation) for situation, _ in known] == [d for _, d in known]
    monkeypatch.setattr(World, "pull", lambda *_: pytest.fail("simulated again"))
    for physics in (first, second):
        assert [physics.simulate(situation) for situation, _ in known] == [d for _, d in known]
    assert len(known) > 20 and 0 < len(first.table) <= len(known)
    with pytest.raises(pytest.fail.Exception):
        fresh.simulate(known[0][0])
    assert len(fresh.table) == 0
    for physics in (first, second, fresh):
        physics.close()


def test_boxes_under_three_others_are_held_down_in_local_physics_too(situations):
    local, physics = LocalPhysics(), TablePhysics()
    heavy = [each for each in situations if each.on_top >= HELD_DOWN][::3]
    assert len(heavy) > 15
    for situation in heavy:
        assert physics.simulate(situation) == 0
        assert local.simulate(situation) < task.LIFT_THRESHOLD
    assert len(physics.table) == 0
    local.close()
    physics.close()


def test_a_box_under_two_others_is_simulated_and_one_under_three_is_not(boxes):
    tower = boxes((1.2, 0.2), (1.2, 0.6), (1.2, 1.0), (1.2, 1.4))
    around = Surroundings(tower, np.ones(4, dtype=bool))
    physics = TablePhysics(LiftTable())
    assert physics.simulate(around.situation(0)) == 0 and len(physics.table) == 0
    distance = physics.simulate(around.situation(1))
    assert 0 < distance < task.LIFT_THRESHOLD and len(physics.table) == 1
    physics.close()


def test_threads_that_share_a_table_get_the_right_answers(known, rng):
    """Each thread has a physics, hence a world, of its own."""
    shared, together = LiftTable(), Barrier(4)
    orders = [rng.permutation(len(known)) for _ in range(4)]

    def work(order) -> list[float]:
        physics = TablePhysics(shared)
        together.wait()
        answers = {number: physics.simulate(known[number][0]) for number in order.tolist()}
        physics.close()
        return [answers[number] for number in range(len(known))]

    with ThreadPoolExecutor(4) as pool:
        answers = list(pool.map(work, orders))
    assert answers == [[distance for _, distance in known]] * 4
    assert [shared.find(situation) for situation, _ in known] == answers[0]


def test_threads_that_ask_first_share_one_table(monkeypatch):
    read, together = LiftTable.load, Barrier(4)
    loads = []
    monkeypatch.setattr(LiftTable, "load", lambda path: loads.append(path) or read(path))
    table._read_once.cache_clear()

    def ask(number: int) -> LiftTable:
        together.wait()
        return table.shared_table()

    with ThreadPoolExecutor(4) as pool:
        assert len(set(pool.map(ask, range(4)))) == 1
    assert loads == [LIFTS_FILE]


def test_without_a_shipped_table_the_shared_one_is_empty_at_first(monkeypatch, tmp_path):
    monkeypatch.setattr(table, "LIFTS_FILE", tmp_path / "missing.npz")
    table._read_once.cache_clear()
    assert len(table.shared_table()) == 0
    table._read_once.cache_clear()


def test_shipped_table_fits_this_physics(known):
    shipped = LiftTable.load(LIFTS_FILE)
    assert len(shipped) > 1000
    found = [(shipped.find(situation), distance) for situation, distance in known]
    assert sum(distance is not None for distance, _ in found) > 20
    assert all(distance in (None, answer) for distance, answer in found)


def test_a_table_is_needed():
    with pytest.raises(TypeError, match="table is 3; expected a LiftTable or None"):
        TablePhysics(3)
