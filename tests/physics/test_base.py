"""What all three physics have in common, and lifts of a box in its situation."""

import os
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from tests.physics.kinds import EACH, KINDS, ONE_BOX, TWO_BOXES, lifts, make
from unload.load.boxes import _SMALLEST_EDGE, Load
from unload.load.substacks import build_load
from unload.physics.bullet import World
from unload.physics.local import LocalPhysics
from unload.physics.situation import Situation


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
def test_the_smallest_boxes_of_a_load_are_simulated(kind):
    """Physics takes the gap off their edges, of which something must be left."""
    edge = _SMALLEST_EDGE
    positions = [[3.5, 1.2 + edge * column, edge * (row + 0.5)] for column, row in np.ndindex(2, 2)]
    physics = make(kind, Load(positions, np.full((4, 3), edge)))
    assert (np.array(lifts(physics, range(4))) >= 0).all()


@pytest.mark.parametrize("kind", EACH)
@pytest.mark.parametrize("call", ["lift", "remove"])
@pytest.mark.parametrize(
    ("item", "error", "message"),
    [
        (1, ValueError, "item 1 has been removed"),
        (2, ValueError, "item is 2; expected an integer >= 0 and <= 1"),
        (-1, ValueError, "item is -1"),
    ],
)
def test_bad_items_are_refused(boxes, kind, call, item, error, message):
    physics = make(kind, boxes((1.2, 0.2), (2.0, 0.2)))
    physics.remove(1)
    with pytest.raises(error, match=message):
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


@pytest.mark.parametrize("kind", EACH)
def test_an_interrupted_reset_needs_another_one(boxes, kind, monkeypatch):
    physics, load = make(kind, boxes((1.2, 0.2))), boxes((1.2, 0.2), (1.2, 0.6))
    interrupted = Mock(side_effect=KeyboardInterrupt)
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr("unload.physics.bullet.World.add_box", interrupted)
        patch.setattr("unload.physics.local.Surroundings", interrupted)
        physics.reset(load)
    with pytest.raises(RuntimeError, match="the physics holds no load; call reset first"):
        physics.lift(0)
    physics.reset(load)
    with pytest.raises(TypeError, match="load is 'walls'; expected an unload.Load"):
        physics.reset("walls")
    assert physics.lift(0) == make(kind, load).lift(0)


@pytest.mark.parametrize("kind", ["local", "table"])
def test_a_lift_has_no_effect(small_load, kind):
    physics = make(kind, small_load)
    items = range(20, len(small_load), 3)
    forwards = [physics.lift(item) for item in items]
    assert [physics.lift(item) for item in reversed(items)] == forwards[::-1]
    assert (physics.positions() == small_load.positions).all() and physics.present.all()


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


@pytest.mark.pybullet
@pytest.mark.needs("/proc")
def test_the_memory_of_many_lifts_is_flat(monkeypatch):
    """Of boxes of ever new sizes; without a pull, which takes nearly all of the time."""
    monkeypatch.setattr(World, "pull", lambda *_: 0.0)
    monkeypatch.setattr("unload.physics.local._MOST_BODIES", 1_500)
    physics, resident = LocalPhysics(), []
    for number in range(6_001):
        boxes = np.array([(0, 0, 0, 500_000, 400_000, 300_000 + number)] * 2)
        boxes[:, 2] = 350_000 * np.arange(2)
        physics.simulate(Situation(boxes, 1, -200_000, ()))
        if number % 1_500 == 0:
            pages = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1])
            resident.append(pages * os.sysconf("SC_PAGE_SIZE") / 2**20)
    assert max(resident[2:]) - resident[1] < 5, "MiB"
