"""The compiled loops of many containers, against the page's, box by box."""

from unittest.mock import Mock

import numpy as np
import pytest

from tests.env.comparing import assert_same
from unload.env.vector import ContainerVectorEnv
from unload.fast import containers
from unload.physics.table import LiftTable, TablePhysics


def test_a_box_that_moves_by_exactly_the_threshold_is_unloaded():
    """One that moves by less moves by as much again, whatever the physics knows."""
    envs = ContainerVectorEnv(2)
    envs.reset(seed=0)
    distances = np.array([0.2, np.nextafter(0.2, 0)])
    state, actions = envs._containers, np.zeros(2, np.int64)
    rewards = containers.unload_lifted(state, actions, distances, False, False)
    assert rewards.tolist() == [1, -1] and state.unloaded.tolist() == [1, 0]
    again = containers.look_up(state, actions, *containers.NOTHING_KNOWN)[1]
    assert again.tolist() == [containers.UNKNOWN, distances[1]]


@pytest.mark.parametrize("physics", [None, TablePhysics(LiftTable())])
def test_known_lifts_are_looked_up_by_the_compiled_loop(physics, monkeypatch):
    """Which changes no bit if it is missing, but a run takes twice as long."""
    envs = ContainerVectorEnv(4, *(() if physics is None else (physics,)))
    actions = np.random.default_rng(0).integers(128, size=(100, 4))

    def play() -> list:
        return [envs.reset(seed=0), *map(envs.step, actions)]

    first = play()
    asked = Mock(side_effect=AssertionError("the table knows it"))
    monkeypatch.setattr(TablePhysics, "simulate", asked)
    assert_same(play(), first)
