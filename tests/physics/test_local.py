"""Lifts of a box in its situation."""

import pytest

from unload.physics.bullet import World
from unload.physics.local import LocalPhysics


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


def test_a_world_that_is_emptied_of_old_sizes_gives_the_same(situations, monkeypatch):
    physics, fresh = LocalPhysics(), LocalPhysics()
    expected = [fresh.simulate(situation) for situation in situations[:30]]
    monkeypatch.setattr("unload.physics.local.MOST_SHAPES", 3)
    for situation, distance in zip(situations, expected):
        assert physics.simulate(situation) == distance
        assert physics._world.shapes <= len(situation.boxes) + 3
    assert fresh._world.shapes > 10
    physics.close()
    fresh.close()
