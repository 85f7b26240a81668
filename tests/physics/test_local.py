"""Lifts of a situation, what all physics have in common, and a physics of one's own."""

from functools import partial
from unittest.mock import Mock

import numpy as np
import pytest

from tests.load.walls import of_corners
from unload import ContainerEnv, Load, evaluate, policies
from unload.env.vector import ContainerVectorEnv
from unload.load.substacks import build_load
from unload.physics.bullet import World
from unload.physics.full import FullPhysics
from unload.physics.local import LocalPhysics
from unload.physics.table import TablePhysics

KINDS = {"full": FullPhysics, "local": LocalPhysics, "table": partial(TablePhysics, exact=True)}
KINDS["mujoco"] = partial(LocalPhysics, "mujoco")
# The same as parameters of tests.
EACH = [pytest.param("full", marks=pytest.mark.pybullet), "local", "table", "mujoco"]
ONE_BOX, TWO_BOXES = 0.46, 0.009  # m, for 20 N and 1 kg


class Held:
    """A load, of which a physics of situations lifts items as ``FullPhysics`` does."""

    def __init__(self, physics: LocalPhysics, load: Load) -> None:
        self._physics, self._load, self.present = physics, load, np.ones(len(load), bool)

    def lift(self, item: int) -> float:
        return self._physics.lift(self._load, self.present, item)

    def remove(self, item: int) -> None:
        self.present[item] = False


def make(kind: str, load: Load, **options) -> FullPhysics | Held:
    """A physics that holds ``load``."""
    physics = KINDS[kind](**options)
    if kind != "full":
        return Held(physics, load)
    physics.reset(load)
    return physics


def lifts(physics: FullPhysics | Held, items) -> list[float]:
    return [physics.lift(int(item)) for item in items]


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


@pytest.mark.pybullet
def test_an_interrupted_lift_leaves_nothing_in_the_way(situations, monkeypatch):
    interrupted, fresh = LocalPhysics(), LocalPhysics()
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(World, "pull", Mock(side_effect=KeyboardInterrupt))
        interrupted.simulate(situations[0])
    for situation in situations[:3]:
        assert interrupted.simulate(situation) == fresh.simulate(situation)


@pytest.mark.pybullet
def test_a_physics_that_is_closed_starts_again(situations):
    physics = LocalPhysics("pybullet")
    first = physics.simulate(situations[0])
    physics.close()
    physics.close()
    assert physics._world is None and physics.simulate(situations[0]) == first


@pytest.mark.pybullet
def test_a_world_that_is_cleared_gives_the_same(situations, monkeypatch):
    physics, fresh = LocalPhysics(), LocalPhysics()
    expected = [fresh.simulate(situation) for situation in situations[:10]]
    monkeypatch.setattr("unload.physics.local._MOST_BODIES", 3)
    for situation, distance in zip(situations, expected):
        assert physics.simulate(situation) == distance
        assert physics._world.bodies <= len(situation.boxes) + 6
    assert fresh._world.bodies > 30
    fresh._world.add_box((0, 0, 0), (1, 1, 1), 1.0)
    fresh._world.clear()
    assert fresh._world.client.getNumBodies() == fresh._world.bodies == 0


class Half(LocalPhysics):
    """Lifts every box by half a metre."""

    def simulate(self, situation) -> float:
        return 0.5


def test_a_load_with_an_overhang_is_refused_where_contacts_alone_are_followed():
    """A plank on two posts over a low box, which it would be pulled through."""
    corners = [(0, 0, 0), (2.5, 0, 0), (1.5, 0, 0), (0, 0, 0.5)]
    sizes = [(0.5, 1, 0.5), (0.5, 1, 0.5), (0.5, 1, 0.4), (3, 1, 0.2)]
    load = of_corners(corners, sizes, ids=["left", "right", "low", "plank"])
    for env in (ContainerVectorEnv(1), ContainerEnv("local"), ContainerEnv("table")):
        with pytest.raises(ValueError, match="plank hangs over low; expected .*physics='full'"):
            env.reset(options={"load": load})


@pytest.mark.pybullet
def test_full_physics_takes_a_load_with_an_overhang():
    load = of_corners(
        [(0, 0, 0), (1, 0, 0), (0, 0, 0.5)], [(1, 1, 0.5), (0.5, 1, 0.4), (1.3, 1, 0.2)]
    )
    physics = make("full", load)
    assert physics.lift(1) < 0.8 * ONE_BOX, "the plank is in its way"
    physics.remove(2)
    assert physics.lift(1) == pytest.approx(ONE_BOX, rel=0.02)


def test_a_physics_of_ones_own_decides(boxes):
    load, own = boxes((0.3, 0.2), (0.3, 0.6)), Half()
    for _ in range(2):  # also after it was closed along with an environment
        env = ContainerEnv(own)
        env.reset(options={"load": load})
        assert env.step(1)[4]["distance"] == 0.5
        env.close()
        table = evaluate(policies.random, 2, physics=own, stack=lambda rng: load, max_picks=2)
        assert (table["success_rate"] == 1).all()
    envs = ContainerVectorEnv(2, physics=own)  # which no table answers for
    envs.reset(options={"load": load})
    assert envs.step(np.array([1, 0]))[4]["distance"].tolist() == [0.5, 0.5]
