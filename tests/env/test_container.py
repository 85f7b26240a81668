from copy import deepcopy
from functools import partial

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env

from tests.env.comparing import CONTAINER, HIGHEST, assert_same, few_items, make_env
from unload import ContainerEnv, plain
from unload.drawing.picture import snapshot
from unload.env import observation
from unload.env.highest_item import HighestItemVectorEnv
from unload.env.vector import ContainerVectorEnv
from unload.load.boxes import CONTACT_TOLERANCE
from unload.load.substacks import build_load
from unload.physics.full import FullPhysics
from unload.physics.local import LocalPhysics
from unload.physics.table import TablePhysics


@pytest.mark.parametrize("equalize", [False, True])
@pytest.mark.parametrize("env_id", [CONTAINER, HIGHEST])
def test_check_env(env_id, equalize):
    env = gymnasium.make(env_id, equalize=equalize)
    check_env(env.unwrapped, skip_render_check=True)


def test_a_physics_of_ones_own_stands_in_the_spec():
    """Gymnasium copies it, which the table's lock once forbade."""
    assert gymnasium.make(CONTAINER, physics=TablePhysics()).spec is not None


@pytest.mark.parametrize("env_id", [CONTAINER, HIGHEST])
def test_a_single_environment_is_the_plain_one(env_id, rng):
    container = env_id == CONTAINER
    # One is emptied, the other one goes on until it is cut off.
    own = {"max_picks": 50}
    if container:
        own = {"max_picks": 999, "stack": lambda rng: few_items(rng, 140)}
    env = make_env(env_id, **own).unwrapped
    page = (plain.Container if container else plain.HighestItem)(**own)
    result = env.reset(seed=3)
    assert_same(result, page.reset(seed=3))
    ended = False
    while not ended:
        rows = (result[0][:, 2].argmax(), rng.integers(128))
        row = rows[rng.random() < 0.2]  # as an array, as Stable-Baselines3's predict gives it
        result = env.step(np.array(row))
        assert_same(result, page.step(row))
        assert (env.action_masks() == result[-1]["action_mask"]).all()
        if container:
            assert_same(env.visible, page.visible)
            assert_same(env.observed_positions(), page.positions)
            assert_same(env.present, page.present)
        ended = result[2] or result[3]
    assert result[2] == container
    with pytest.raises(ResetNeeded, match="the episode is finished; call reset first"):
        env.step(0)
    assert_same(env.reset(), page.reset())
    assert env.np_random.random() == page.np_random.random()


def test_positions_are_blurred_and_sunk(full_load):
    env = make_env().unwrapped
    env.reset(seed=0, options={"load": full_load})
    blur = env.observed_positions() - full_load.positions
    env.observed_positions()[:] = 0  # a copy
    assert np.array_equal(env.observed_positions(), full_load.positions + blur)
    assert not observation.drift(3, 0.0, env.np_random).any(), "without noise nothing sinks"
    assert blur.std(axis=0) == pytest.approx(0.0005, rel=0.1)
    assert blur.mean(axis=0) == pytest.approx([0, 0, -0.001], abs=1e-4)


def test_the_reward_needs_the_threshold_whatever_physics_decides():
    class Fixed(LocalPhysics):
        def simulate(self, situation) -> float:
            return self.distance

    physics = Fixed()
    env = make_env(physics=physics)
    env.reset(seed=0)
    for distance, reward in ((0.2, 1), (0.46, 1), (0.1999, -1), (0.0, -1)):
        physics.distance = distance
        assert env.step(int(env.unwrapped.action_masks().argmax()))[1] == reward
        allowed = env.unwrapped.action_masks()
        assert env.unwrapped.liftable()[allowed].tolist() == [reward == 1] * allowed.sum()


@pytest.mark.parametrize("env_id", [CONTAINER, HIGHEST])
@pytest.mark.parametrize("kind", [make_env, partial(gymnasium.make_vec, num_envs=2)])
def test_a_copy_goes_on_alone_with_the_same_bits(kind, env_id, rng):
    """As a search needs it: from the copied state, in any order, beyond the episode's end."""
    env = kind(env_id, max_picks=5).unwrapped
    env.reset(seed=0)
    vector = isinstance(env, ContainerVectorEnv | HighestItemVectorEnv)
    actions = rng.integers(128, size=(6, 2)) if vector else rng.integers(128, size=6)

    def play(env) -> list:
        results = [env.step(action) for action in actions[2:5]]
        return [*results, env.step(actions[5]) if vector else env.reset(), env.action_masks()]

    for action in actions[:2]:
        env.step(action)
    first, second = deepcopy(env), deepcopy(env)
    played = play(first)
    assert_same(play(env), played)
    assert_same(play(second), played)
    if env_id == CONTAINER:
        assert first.physics is env.physics, "the table is shared"


@pytest.mark.parametrize("env_id", [CONTAINER, HIGHEST])
def test_an_environment_goes_on_from_what_another_one_keeps(env_id, rng):
    one, other = (gymnasium.make_vec(env_id, 2, max_picks=5).unwrapped for _ in range(2))
    actions = rng.integers(128, size=(8, 2))
    for seed, env in enumerate((one, other)):
        env.reset(seed=seed)
    for action in actions[:2]:
        one.step(action)
    other.load_state_dict(deepcopy(one.state_dict()))
    for action in actions[2:]:
        assert_same(one.step(action), other.step(action))


@pytest.mark.pybullet
def test_a_simulator_is_not_copied():
    env = ContainerEnv("full", stack=lambda rng: build_load(np.zeros((1, 3, 4), int)))
    env.reset(seed=0)
    with pytest.raises(TypeError, match="a simulator of PyBullet cannot be copied or pickled"):
        deepcopy(env)


@pytest.mark.parametrize("make", [ContainerEnv, partial(ContainerVectorEnv, 2)])
def test_loads_of_something_else_or_of_floating_boxes_are_refused(make, boxes):
    tower = boxes((1.2, 0.2), (1.2, 0.6 + 2 * CONTACT_TOLERANCE))
    with pytest.raises(TypeError, match="what stack returned is 'boxes'; expected an unload.Load"):
        make(stack=lambda rng: "boxes").reset(seed=0)
    with pytest.raises(ValueError, match=r"floats in what stack returned, .* 0.4002 m"):
        make(stack=lambda rng: tower).reset(seed=0)
    with pytest.raises(ValueError, match="floats in load"):
        make().reset(options={"load": tower})


@pytest.mark.pybullet
def test_drifting_boxes_are_seen_where_they_are():
    """And what has failed stays so. Few enough to be quick, because each of them is simulated."""
    settings = {"physics": FullPhysics("keep"), "render_mode": "rgb_array"}
    env = make_env(**settings, stack=lambda rng: build_load(np.zeros((2, 3, 4), int)), max_picks=3)
    env.reset(seed=0)
    container = env.unwrapped
    neat = container.load.positions
    assert (container.observed_positions() == neat).all()
    failed = container.visible[127]
    seen, *_, info = env.step(127)
    assert (info["action_mask"] == (container.visible != failed)).all()
    drift = container.observed_positions() - neat
    assert 0 < np.abs(drift).max() < 0.02
    assert (seen == observation.scale((neat + drift)[container.visible])).all()
    _, reward, *_, info = env.step(seen[:, 2].argmax())
    assert info["action_mask"].all()
    load, present = container.load, container.present
    places = container.observed_positions()
    assert reward == 1 and (snapshot(load, present, places) == env.render()).all()
    with pytest.raises(ValueError, match="lifts move other boxes; expected"):
        container.liftable()
