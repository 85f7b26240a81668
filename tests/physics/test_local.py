"""Lifts of a box in its situation."""

import numpy as np
import pytest

from tests.physics.kinds import ONE_BOX
from unload import task
from unload.load.boxes import Load
from unload.load.substacks import CELL, stack_load
from unload.physics.bullet import World
from unload.physics.full import FullPhysics
from unload.physics.local import LocalPhysics
from unload.physics.situation import Surroundings


def hard_items(load: Load, present: np.ndarray) -> list[int]:
    """Items under exactly one box that rests only partly on them."""
    around = Surroundings(load, present)
    low, high = load.positions - load.sizes / 2, load.positions + load.sizes / 2
    hard = []
    for item in np.flatnonzero(present).tolist():
        above = around.on_top(item)
        if len(above) == 1:
            inside = low[above[0], 1] > low[item, 1] - CELL / 2
            inside &= high[above[0], 1] < high[item, 1] + CELL / 2
            if not inside:
                hard.append(item)
    return hard


def partly_unloaded(load: Load, share: float, rng: np.random.Generator) -> Load:
    """The load after a share of its items, each with nothing on it, has been taken out."""
    present = np.ones(len(load), dtype=bool)
    around = Surroundings(load, present)
    while present.mean() > 1 - share:
        free = [item for item in np.flatnonzero(present).tolist() if not around.on_top(item)]
        present[rng.choice(free)] = False
    fields = (load.positions, load.sizes, load.packages, load.walls)
    return Load(*(field[present] for field in fields))


@pytest.mark.slow
def test_local_agrees_with_full():
    """On picks of loads in all states, half of them of the hard class if there are any."""
    rng = np.random.default_rng(2)
    full, local = FullPhysics(), LocalPhysics()
    results = []
    for walls, share in ((3, 0.0), (1, 0.4), (2, 0.6), (2, 0.7), (1, 0.8)):
        load = partly_unloaded(stack_load(rng, walls=walls), share, rng)
        full.reset(load)
        local.reset(load)
        for number in range(11):
            hard = hard_items(load, local.present) if number % 2 else []
            item = int(rng.choice(hard if hard else np.flatnonzero(local.present)))
            distances = full.lift(item), local.lift(item)
            results.append((bool(hard), *distances))
            if min(distances) >= task.LIFT_THRESHOLD and not hard:
                full.remove(item)
                local.remove(item)
    full.close()
    local.close()
    hard, distances = np.array(results)[:, 0].astype(bool), np.array(results)[:, 1:]
    success = distances >= task.LIFT_THRESHOLD
    agree = success[:, 0] == success[:, 1]
    print(
        f"\nlocal and full agree on {agree.sum()} of {len(agree)} picks and on "
        f"{agree[hard].sum()} of {hard.sum()} hard ones; lifted: {success[:, 0].sum()} and "
        f"{success[hard, 0].sum()}"
    )
    assert len(agree) == 55 and hard.sum() >= 20 and success[:, 0].sum() >= 5
    near = ((distances > 0.17) & (distances < 0.23)).all(axis=1)
    assert (agree | near).all(), distances[~agree]
    assert agree.mean() >= 0.97


@pytest.mark.parametrize("kind", ["local", "table"])
def test_a_lift_has_no_effect(make, small_load, kind):
    physics = make(kind, small_load)
    items = range(20, len(small_load))
    forwards = [physics.lift(item) for item in items]
    assert [physics.lift(item) for item in reversed(items)] == forwards[::-1]
    assert (physics.positions() == small_load.positions).all() and physics.present.all()


def test_an_interrupted_lift_leaves_nothing_in_the_way(situations, monkeypatch):
    interrupted, fresh = LocalPhysics(), LocalPhysics()

    def interrupt(world, body):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(World, "pull", interrupt)
        interrupted.simulate(situations[0])
    for situation in situations[:10]:
        assert interrupted.simulate(situation) == fresh.simulate(situation)
    interrupted.close()
    fresh.close()


def test_pybullet_is_started_at_the_first_lift(make, boxes):
    physics = make("local", boxes((1.2, 0.2)))
    assert physics._world is None
    assert physics.lift(0) == pytest.approx(ONE_BOX, rel=0.02)
    assert physics._world is not None


def test_a_world_of_many_shapes_is_replaced_by_one_that_lifts_alike(make, situations, monkeypatch):
    """PyBullet cannot free a shape: where sizes vary continuously, memory would grow for ever."""
    kept, replaced = LocalPhysics(), LocalPhysics()
    monkeypatch.setattr("unload.physics.local.MOST_SHAPES", 12)
    worlds = set()
    for situation in situations[:20]:
        distance = replaced.simulate(situation)
        assert replaced._world.shapes < 12 + len(situation.boxes) + 3
        worlds.add(replaced._world)
        monkeypatch.setattr("unload.physics.local.MOST_SHAPES", 10_000)
        assert kept.simulate(situation) == distance
        monkeypatch.setattr("unload.physics.local.MOST_SHAPES", 12)
    assert len(worlds) > 2
    kept.close()
    replaced.close()
