"""Lifts in fresh worlds of ``full``."""

import numpy as np
import pytest

from unload.load.substacks import stack_load
from unload.physics.local import LocalPhysics
from unload.physics.situation import Surroundings
from unload.reproduce.lifts import full
from unload.reproduce.lifts.full import State


@pytest.fixture(scope="module")
def state():
    """A container of three walls from which a third of the free boxes has been taken."""
    load, rng = stack_load(np.random.default_rng(4), 3), np.random.default_rng(0)
    present = np.ones(len(load), bool)
    surroundings = Surroundings(load, present)
    free = [item for item in range(len(load)) if not surroundings.on_top(item)]
    present[rng.choice(free, len(free) // 3, replace=False)] = False
    visible = rng.choice(np.flatnonzero(present), 30, replace=False)
    return State("random", 4, 0, load, present, visible)


def test_boxes_left_are_those_of_the_walls_around(monkeypatch, state):
    monkeypatch.setattr(full, "NEAR_WALLS", 1)
    left, items = full.boxes_left(state, 1, 1)
    assert set(left.walls) == {1}
    assert (items == np.flatnonzero(state.present & (state.load.walls == 1))).all()
    assert (left.positions == state.load.positions[items]).all()
    monkeypatch.setattr(full, "NEAR_WALLS", 3)
    assert set(full.boxes_left(state, 0, 3)[0].walls) == {0, 1}
    left, items = full.boxes_left(state, 0, full.WALLS)
    assert (items == np.flatnonzero(state.present)).all()


def test_a_fresh_world_lifts_the_item_it_was_asked_about(monkeypatch, state):
    """With fewer walls around, the item has another number; its distance is that of ``local``."""
    monkeypatch.setattr(full, "NEAR_WALLS", 1)
    local = LocalPhysics()
    local.reset(state.load)
    for item in np.flatnonzero(~state.present):
        local.remove(item)
    blocked = {item: bool(local.surroundings.on_top(item)) for item in state.visible.tolist()}
    for wanted in (True, False):
        item = next(item for item, is_so in blocked.items() if is_so == wanted)
        question, compute = full.fresh_job(state, item, 1)
        assert set(question) == {"settings", "boxes", "item"}
        assert compute() == pytest.approx(local.lift(item), abs=0.01)
    local.close()
    another, _ = full.fresh_job(state, item, full.WALLS)
    assert another != question
