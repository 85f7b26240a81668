"""Lifts of a box in its situation."""

import os
from pathlib import Path

import numpy as np
import pytest

from unload.physics.bullet import World
from unload.physics.local import LocalPhysics
from unload.physics.situation import Situation


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


def test_a_world_that_is_cleared_gives_the_same(situations, monkeypatch):
    physics, fresh = LocalPhysics(), LocalPhysics()
    expected = [fresh.simulate(situation) for situation in situations[:30]]
    monkeypatch.setattr("unload.physics.local.MOST_BODIES", 3)
    for situation, distance in zip(situations, expected):
        assert physics.simulate(situation) == distance
        assert physics._world.bodies <= len(situation.boxes) + 6
    assert fresh._world.bodies > 100


@pytest.mark.slow
def test_the_memory_of_many_lifts_is_flat(monkeypatch):
    """Of boxes of ever new sizes; without a pull, which takes nearly all of the time."""
    monkeypatch.setattr(World, "pull", lambda world, body: 0.0)
    physics, resident = LocalPhysics(), []
    for number in range(20_001):
        boxes = np.array([(0, 0, 0, 500_000, 400_000, 300_000 + number)] * 2)
        boxes[:, 2] = 350_000 * np.arange(2)
        physics.simulate(Situation(boxes, 1, -200_000, ()))
        if number % 5_000 == 0:
            pages = int(Path("/proc/self/statm").read_text().split()[1])
            resident.append(pages * os.sysconf("SC_PAGE_SIZE") / 2**20)
    assert max(resident[2:]) - resident[1] < 10, "MiB"
