"""What all environments have in common: settings, and the order of calls."""

from functools import partial
from unittest.mock import DEFAULT, Mock

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from gymnasium.vector import AutoresetMode

from tests.env.comparing import CONTAINER, HIGHEST, assert_same, make_env
from unload import ContainerEnv, HighestItemEnv, stack_load
from unload.env import base
from unload.env.highest_item import HighestItemVectorEnv
from unload.env.vector import ContainerVectorEnv
from unload.physics.full import FullPhysics


def container(**kwargs) -> ContainerEnv:
    return ContainerEnv("table", **kwargs)


ALL = [container, HighestItemEnv, ContainerVectorEnv, HighestItemVectorEnv]


@pytest.mark.parametrize(
    ("make", "kwargs", "error", "message"),
    [
        (ContainerVectorEnv, {"equalize": 1}, TypeError, "equalize is 1; expected True or False"),
        (ContainerVectorEnv, {"ties": "coin"}, ValueError, "ties is 'coin'"),
        (container, {"max_picks": 2**63}, ValueError, "max_picks is 9223372036854775808; .* <= "),
        (HighestItemEnv, {"position_noise": 1e300}, ValueError, r"is 1e\+300; .*\[0, 10.0\]"),
        (ContainerEnv, {"render_mode": "human"}, ValueError, "render_mode is 'human'"),
        (ContainerEnv, {"physics": "mujoco"}, ValueError, "physics is 'mujoco'; expected 'local'"),
        (ContainerVectorEnv, {"num_envs": 0}, ValueError, "num_envs is 0"),
        (
            ContainerVectorEnv,
            {"physics": FullPhysics()},
            TypeError,
            "a LocalPhysics, whose simulate",
        ),
        (ContainerEnv, {"stack": 3}, TypeError, "stack is 3"),
        (ContainerVectorEnv, {"render_mode": "rgb_array"}, ValueError, "expected one of None"),
    ],
)
def test_bad_settings_are_refused(make, kwargs, error, message):
    with pytest.raises(error, match=message):
        make(**kwargs)


@pytest.mark.parametrize("make", ALL)
def test_nothing_works_before_reset_or_after_close(make):
    env = make()
    action = np.zeros(64, int) if isinstance(env, gymnasium.vector.VectorEnv) else 0
    calls = [lambda: env.step(action)]
    calls += [env.render] if isinstance(env, gymnasium.Env) else []
    calls += [lambda: env.visible] if make is ContainerVectorEnv else []
    names = ("action_masks", "liftable", "state", "observed_positions")
    calls += [getattr(env, name) for name in names if hasattr(env, name)]
    for call in calls:
        with pytest.raises(ResetNeeded, match="not started; call reset first"):
            call()
    env.reset(seed=0)
    env.close()
    env.close()
    for call in (*calls, env.reset):
        with pytest.raises(ClosedEnvironmentError, match="the environment is closed"):
            call()


@pytest.mark.parametrize("make", ALL)
def test_the_strongest_noise_stays_in_the_observation_space(make):
    env = make(position_noise=10.0)
    seen, _ = env.reset(seed=0)
    assert env.observation_space.contains(seen) and np.abs(seen).max() == 1


def test_seeds():
    envs = gymnasium.make_vec(CONTAINER, 2)
    first, _ = envs.reset(seed=0)
    listed, _ = envs.reset(seed=[1, 0])
    assert (first == listed[::-1]).all()
    assert not (envs.reset()[0] == listed).all()
    assert (envs.reset(seed=[None, 0])[0][1] == first[0]).all()
    unseeded, _ = gymnasium.make_vec(CONTAINER, 2).reset()
    assert not (unseeded[0] == unseeded[1]).all()


ARRAY = partial(gymnasium.make_vec, num_envs=2)


@pytest.mark.parametrize(
    ("make", "env_id", "given", "error", "message"),
    [
        (ARRAY, CONTAINER, [0, 128], ValueError, "actions holds 0 to 128; expected 0 to 127"),
        (ARRAY, CONTAINER, [0], ValueError, r"actions has shape \(1,\); expected \(2,\)"),
        (make_env, CONTAINER, 128, ValueError, "action is 128; .* >= 0 and <= 127"),
        (make_env, CONTAINER, np.array([3]), TypeError, r"action is array\(\[3\]\)"),
        (ARRAY, CONTAINER, {"seed": [1, 2, 3]}, ValueError, "seed holds 3 seeds; expected 2"),
        (ARRAY, CONTAINER, {"seed": [1, -1]}, ValueError, "seed is -1; expected an integer >= 0"),
        (ARRAY, CONTAINER, {"seed": 3, "options": {"load": None}}, TypeError, "load is None; expe"),
        (ARRAY, CONTAINER, {"seed": 3, "options": {"loads": 1}}, ValueError, "1}; expected load"),
        (make_env, CONTAINER, {"seed": 3, "options": []}, TypeError, r"options is \[\]; expected"),
        (make_env, HIGHEST, {"seed": 3, "options": {"load": 1}}, ValueError, "1}; expected none"),
    ],
)
def test_bad_input_changes_nothing(make, env_id, given, error, message):
    """Both draw the same at the next resets, and were given the same picks before."""
    env, other = make(env_id), make(env_id)
    for each in (env, other):
        each.reset(seed=0)
    with pytest.raises(error, match=message):
        env.reset(**given) if isinstance(given, dict) else env.step(given)
    actions = 3 if make is make_env else [3, 4]
    for _ in range(2):
        assert_same(env.step(actions), other.step(actions))
        assert_same(env.reset(), other.reset())


@pytest.mark.parametrize("failing", [1, 2, 3])
def test_a_call_whose_stack_fails_needs_a_reset(failing):
    """The first reset, the second one, and the next one, which an array makes in a step."""
    outcomes = [*[DEFAULT] * (failing - 1), OSError("full"), *[DEFAULT] * 9]
    stack = Mock(wraps=stack_load, side_effect=outcomes)
    env, other = (ContainerVectorEnv(1, max_picks=1, stack=each) for each in (stack, stack_load))
    with pytest.raises(OSError, match="full"):
        env.reset(seed=0)
        env.reset(seed=0)
        env.step([0])
        env.reset(seed=0)
    for call in (lambda: env.step([0]), env.action_masks):
        with pytest.raises(ResetNeeded, match="the episode is broken off; call reset first"):
            call()
    assert_same(env.reset(seed=0), other.reset(seed=0))
    assert_same(env.step([0]), other.step([0]))


def test_a_step_that_stops_after_the_next_episode_has_begun_needs_a_reset(set_in):
    envs = HighestItemVectorEnv(1, autoreset_mode=AutoresetMode.NEXT_STEP, max_picks=1)
    envs.reset(seed=0)
    envs.step([0])
    set_in(base, _flagged=Mock(side_effect=KeyboardInterrupt))  # is called after it
    with pytest.raises(KeyboardInterrupt):
        envs.step([0])
    with pytest.raises(ResetNeeded, match="the episode is broken off; call reset first"):
        envs.action_masks()


def test_results_are_no_views_of_what_the_environments_hold():
    envs = ContainerVectorEnv(2)
    seen, infos = envs.reset(seed=0)
    kept = [seen, infos["action_mask"], infos["unloaded"], envs.action_masks(), envs.visible]
    before = [array.copy() for array in kept]
    for _ in range(3):
        envs.step(np.array([seen[0, :, 2].argmax(), seen[1, :, 2].argmin()]))
    for array, then in zip(kept, before):
        assert (array == then).all()
