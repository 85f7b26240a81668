"""The array environments, against Gymnasium's loop over plain ones."""

from unittest.mock import Mock

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode

import unload
from tests.env.comparing import (
    CONTAINER,
    HIGHEST,
    assert_same,
    few_items,
    mixed_stack,
    play_both,
)
from tests.load.walls import crossed_bars, own_load
from unload import plain
from unload.env.vector import ContainerVectorEnv
from unload.physics.local import LocalPhysics
from unload.physics.table import TablePhysics


def test_full_containers_for_whole_episodes_and_beyond():
    play_both(CONTAINER, 3, 520, equalize=True)


def test_a_load_may_be_given(rng):
    """Until the episode ends, after which the load is drawn by lot."""
    play_both(CONTAINER, 2, 4, seed=1, options={"load": few_items(rng, 200)}, max_picks=3)


def test_fewer_boxes_may_have_more_contacts():
    """60 boxes apart, and 40 bars, 20 of them across the others."""
    grid = np.stack(np.meshgrid(0.5 * np.arange(12) + 0.4, 0.5 * np.arange(5) + 0.25, 0.15), -1)
    apart, crossed = unload.Load(grid.reshape(60, 3), np.full((60, 3), 0.3)), crossed_bars(20)
    assert len(crossed.contacts.links) > 800 and len(apart.contacts.links) == 0
    loads = apart, crossed
    play_both(CONTAINER, 2, 30, seed=1, max_picks=5, stack=lambda rng: loads[rng.integers(2)])


@pytest.mark.parametrize("kind", ["continuous sizes", "measured heights"])
def test_containers_and_boxes_of_other_sizes_stand_side_by_side(kind):
    """PyBullet is asked for their lifts, also after a larger load has come into another one."""

    def stack(rng):
        load = own_load(rng, kind)
        fields = {"container": load.container + rng.choice([0.0, 0.3, 5.0], 3)}
        fields["contact_tolerance"] = load.contact_tolerance
        return unload.Load(load.positions, load.sizes, **fields)

    play_both(CONTAINER, 3, 60, seed=3, max_picks=20, stack=stack)


def test_side_walls_and_viewpoint_are_those_of_the_loads_container():
    """A load of the paper, made wider and higher along with its container."""

    class Sides(LocalPhysics):
        def simulate(self, situation) -> float:
            return len(situation.sides) / 100

    neat, scale = unload.build_load(np.zeros((1, 3, 4), int)), np.array([0.9, 1.3, 1.6])
    load = unload.Load(scale * neat.positions, scale * neat.sizes, container=scale * neat.container)
    envs = ContainerVectorEnv(1, Sides(), position_noise=0.0)
    envs.reset(options={"load": load})
    items = envs.visible[0, : len(load)]
    rows = [envs.step([row])[4] for row in range(len(items))]
    sides = [len(plain.situation(load, np.ones(len(load), bool), item).sides) for item in items]
    assert [round(100 * infos["distance"][0]) for infos in rows] == sides
    assert {0, 1} == {*sides}

    # Nearest is what is nearest to the middle of the entrance's upper edge (Sec. III-B).
    offset = load.positions - load.container * (1, 0.5, 1)
    distance = np.sqrt(offset[:, 0] ** 2 + 4 * offset[:, 2] ** 2)
    assert (np.diff(distance[items]) > -1e-9).all()


@pytest.mark.parametrize("seed", range(20))
def test_random_actions_seeds_and_options(seed):
    rng = np.random.default_rng(seed)
    settings = {
        "env_id": (CONTAINER, HIGHEST),
        "num_envs": (1, 2, 3),
        "steps": range(11),
        "seed": (0, seed, 2**63 - 4),
        "equalize": (False, True),
        "ties": ("noise", "average"),
        "position_noise": (0.0, 0.0005, 0.05, 10.0),
        "max_picks": range(1, 10),
    }
    play_both(**{name: values[rng.integers(len(values))] for name, values in settings.items()})


@pytest.mark.parametrize("mode", AutoresetMode)
def test_episodes_that_end_at_different_steps(mode):
    own = {"autoreset_mode": mode, "stack": mixed_stack}
    own |= {"equalize": mode is AutoresetMode.SAME_STEP, "ties": "average"}
    ends = play_both(CONTAINER, 5, 400, seed=2, max_picks=150, **own)
    terminated, truncated = ends.transpose(1, 0, 2)
    assert terminated.any() and truncated.any()
    together = (terminated | truncated).sum(axis=1)
    assert {0, 1} < set(together.tolist())


def test_places_alone_say_what_is_free(monkeypatch):
    monkeypatch.setattr(TablePhysics, "simulate", Mock(side_effect=AssertionError))
    envs = ContainerVectorEnv(1, "places", stack=lambda rng: own_load(rng, "continuous sizes"))
    envs.reset(seed=0)
    load, items = own_load(np.random.default_rng(0), "continuous sizes"), envs.visible[0]
    free = ~load.covered(np.ones(len(load), bool))[items]
    assert_same(envs.liftable()[0], free)
    assert 5 < free.sum() < 120
    single = unload.ContainerEnv("places", stack=envs.stack)
    single.reset(seed=0)
    monkeypatch.undo()
    assert (single.liftable() == free).all()
    assert single.step(int(free.argmin()))[4]["distance"] == 0


def test_an_episode_that_is_over_waits_for_its_reset():
    envs = gymnasium.make_vec(HIGHEST, 2, max_picks=1, autoreset_mode=AutoresetMode.DISABLED)
    with pytest.raises(ResetNeeded):
        envs.reset(options={"reset_mask": np.array([True, False])})
    envs.reset(seed=0)
    envs.step(np.zeros(2, int))
    with pytest.raises(ResetNeeded, match="an episode is finished; call reset with a reset_mask"):
        envs.step(np.zeros(2, int))
    with pytest.raises(ValueError, match=r"options\['reset_mask'\] has shape \(3,\)"):
        envs.reset(options={"reset_mask": np.ones(3, bool)})
