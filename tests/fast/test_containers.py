"""Containers in arrays: what is compiled, against the plain code."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.load.walls import loads
from unload import Load, stack_load
from unload.fast import containers
from unload.load.boxes import CONTACT_TOLERANCE
from unload.physics.situation import Surroundings
from unload.physics.table import EMPTY, FREE_LIFT, HELD_DOWN, LiftTable, digest_of


def filled(load: Load, present: np.ndarray) -> containers.Containers:
    """One container, whose other fields are empty, among two."""
    starts, links = load.contacts
    state = containers.allocate(2, len(load) + 3, len(links) + 1)
    state.sizes[1] = load.container
    state.geometry[1, : len(load)] = np.hstack([load.positions, load.sizes])
    state.starts[1, :, : len(load) + 1] = starts
    state.links[1, : len(links)] = links
    state.present[1, : len(load)] = present
    return state


def assert_digests_agree(load: Load, present: np.ndarray) -> int:
    """Of all present items that are not held down; returns how many of them are."""
    around, state = Surroundings(load, present), filled(load, present)
    members = np.empty(state.present.shape[1], np.int32)
    held_down = 0
    for item in np.flatnonzero(present).tolist():
        dynamic, situation = containers.movers(state, 1, item, members), around.situation(item)
        assert dynamic == min(situation.dynamic, HELD_DOWN + 1)
        if situation.on_top >= HELD_DOWN:
            held_down += 1
        else:
            digest = containers.situation_digest(state, 1, members, dynamic)
            assert digest == digest_of(np.frombuffer(situation.key, np.int32)) != EMPTY
    return held_down


@settings(max_examples=80)
@given(load=loads(), data=st.data())
def test_digests_of_situations_in_random_loads(load, data):
    some = data.draw(st.lists(st.booleans(), min_size=len(load), max_size=len(load)))
    assert_digests_agree(load, np.array(some))


@pytest.mark.parametrize("share", [0.0, 0.9, 1.1])
def test_digests_of_situations_at_walls_and_floor(boxes, share):
    step = share * CONTACT_TOLERANCE
    leaning = boxes((0.5, 0.2), (0.2 + step, 0.6), (2.0, 0.2), (2.3 - step, 0.6))
    lifted = boxes((0.2 + step, 0.2 + step), (2.3 - step, 0.2), (1.2, 0.2 + step))
    wider = Load(leaning.positions + (0, 0.3, 0), leaning.sizes, container=(7, 2.8, 2.5))
    for load in (leaning, lifted, wider):
        assert assert_digests_agree(load, np.ones(len(load), bool)) == 0


@pytest.mark.parametrize("share", [1.0, 0.7, 0.3])
def test_digests_of_situations_in_loads_of_the_paper(rng, share):
    load = stack_load(rng, walls=2)
    held_down = assert_digests_agree(load, rng.random(len(load)) < share)
    assert held_down > 3 or share < 0.5


def test_distances_are_looked_up_or_unknown(boxes):
    heights = (0.2, 0.6, 1.0, 1.4)
    load = boxes(*((1.2, height) for height in heights))
    everywhere, table = np.ones(4, bool), LiftTable()
    state = filled(load, everywhere)
    state.visible[:], state.masks[:] = -1, 1
    state.visible[1, :4] = range(4)
    table.add(Surroundings(load, everywhere).situation(2), 0.25)
    distances = (0, containers.UNKNOWN, 0.25, FREE_LIFT)  # from the lowest box, under three others
    for row, item, distance in (*zip(range(4), range(4), distances), (4, -1, 0)):
        items, distances = containers.look_up(state, np.array([5, row]), *table.slots)
        assert items.tolist() == [-1, item] and distances.tolist() == [0, distance]
    state.masks[1, 1], state.failed[1, 1] = 0, 0.1  # failed before, by so much
    assert containers.look_up(state, np.array([5, 1]), *table.slots)[1].tolist() == [0, 0.1]
