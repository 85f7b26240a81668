"""Episodes, seeds and states of the array environments."""

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from gymnasium.vector import AutoresetMode
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.env.comparing import CONTAINER, HIGHEST, FailingStack, assert_same
from unload.env.vector import ContainerVectorEnv, HighestItemVectorEnv


def test_spaces_and_metadata():
    envs = gymnasium.make_vec(CONTAINER, 5)
    single = gymnasium.make(CONTAINER, physics="table")
    assert envs.single_observation_space == single.observation_space
    assert envs.single_action_space == single.action_space
    assert envs.observation_space.shape == (5, 128, 3) and envs.num_envs == 5
    assert envs.metadata["autoreset_mode"] == AutoresetMode.SAME_STEP
    assert envs.observation_space.contains(envs.reset(seed=0)[0])
    single.close()


def test_results_are_fresh_arrays():
    envs = gymnasium.make_vec(CONTAINER, 2)
    observations, infos = envs.reset(seed=0)
    kept = observations.copy(), infos["action_mask"].copy()
    for _ in range(30):
        envs.step(np.array([100, 3]))
    assert (observations == kept[0]).all() and (infos["action_mask"] == kept[1]).all()
    observations[:] = 9
    assert envs.step(np.array([100, 3]))[0].max() <= 1


def test_seeds():
    envs = gymnasium.make_vec(CONTAINER, 2)
    first, _ = envs.reset(seed=4)
    listed, _ = envs.reset(seed=[5, 4])
    assert (first == listed[::-1]).all()
    assert (envs.reset(seed=[0, 1])[0] == envs.reset(seed=0)[0]).all()
    following, _ = envs.reset()
    assert not (following == listed).all()
    kept, _ = envs.reset(seed=[None, 4])
    assert (kept[1] == first[0]).all()
    unseeded, _ = gymnasium.make_vec(CONTAINER, 2).reset()
    assert not (unseeded[0] == unseeded[1]).all()


def test_a_numpy_seed_is_a_seed():
    envs, other = (HighestItemVectorEnv(3) for _ in range(2))
    assert_same(envs.reset(seed=np.uint8(255)), other.reset(seed=255))  # 255 + 2 does not wrap


# --- resets that fail ---------------------------------------------------------------


@pytest.mark.parametrize("failing", [1, 2])
def test_a_first_reset_that_fails_needs_another_one(failing):
    envs = ContainerVectorEnv(2, stack=FailingStack(failing))
    with pytest.raises(OSError, match="the stack failed"):
        envs.reset(seed=0)
    for call in (lambda: envs.step(np.zeros(2, int)), envs.get_state, envs.action_masks):
        with pytest.raises(ResetNeeded, match="the episodes are not started; call reset first"):
            call()
    other = ContainerVectorEnv(2)
    assert_same(envs.reset(seed=0), other.reset(seed=0))


@pytest.mark.parametrize("seed", [None, 5, [None, 5]])
def test_a_reset_that_fails_changes_nothing(seed, rng):
    envs, other = ContainerVectorEnv(2, stack=FailingStack(4)), ContainerVectorEnv(2)
    for each in (envs, other):
        each.reset(seed=0)
        each.step(np.array([0, 5]))
    with pytest.raises(OSError, match="the stack failed"):
        envs.reset(seed=seed)
    assert_same(envs.get_state(), other.get_state())
    for actions in rng.integers(128, size=(10, 2)):
        assert_same(envs.step(actions), other.step(actions))
    assert_same(envs.reset(), other.reset())  # the generators are as they were, too


def test_a_next_episode_that_cannot_begin_needs_a_reset():
    envs, other = ContainerVectorEnv(2, max_picks=3, stack=FailingStack(4)), ContainerVectorEnv(2)
    for each in (envs, other):
        each.reset(seed=0)
    for _ in range(2):
        envs.step(np.zeros(2, int))
    with pytest.raises(OSError, match="the stack failed"):
        envs.step(np.zeros(2, int))
    for call in (lambda: envs.step(np.zeros(2, int)), envs.get_state, envs.action_masks):
        with pytest.raises(ResetNeeded, match="the episodes are broken off; call reset first"):
            call()
    assert_same(envs.reset(), other.reset())  # the generators are where the episodes began


def test_a_state_whose_picks_cannot_be_repeated_needs_a_reset():
    envs = ContainerVectorEnv(2, max_picks=3, stack=FailingStack(6))
    envs.reset(seed=0)
    state = envs.get_state() | {"actions": np.zeros((4, 2), int)}
    with pytest.raises(OSError, match="the stack failed"):
        envs.set_state(state)
    with pytest.raises(ResetNeeded, match="the episodes are broken off; call reset first"):
        envs.step(np.zeros(2, int))
    envs.set_state(state)  # sets all anew
    envs.step(np.zeros(2, int))


CALLS = st.one_of(
    st.tuples(st.just("reset"), st.none() | st.integers(-1, 3)),
    st.tuples(st.just("step"), st.lists(st.integers(-2, 129), min_size=2, max_size=2)),
    st.tuples(st.just("step"), st.lists(st.integers(0, 127), min_size=2, max_size=2)),
    st.tuples(st.just("get_state"), st.none()),
    st.tuples(st.just("close"), st.none()),
)


@settings(derandomize=True, deadline=None, max_examples=40)
@given(
    make=st.sampled_from([ContainerVectorEnv, HighestItemVectorEnv]),
    failing=st.lists(st.integers(1, 12), max_size=4),
    calls=st.lists(CALLS, max_size=15),
)
def test_whatever_is_called_it_works_or_says_why_not(make, failing, calls):
    """In particular, compiled code never meets arrays that are not filled."""
    stack = {"stack": FailingStack(*failing, walls=2)} if make is ContainerVectorEnv else {}
    envs = make(2, max_picks=2, **stack)
    for name, argument in calls:
        arguments = {"reset": {"seed": argument}, "step": {"actions": argument}}.get(name, {})
        try:
            result = getattr(envs, name)(**arguments)
        except (ValueError, OSError, ResetNeeded, ClosedEnvironmentError):
            continue
        if name == "step":
            assert set(result[1].tolist()) <= {1.0, -1.0} and np.isfinite(result[0]).all()


# --- states -------------------------------------------------------------------------


@pytest.mark.parametrize("env_id", [CONTAINER, HIGHEST])
@pytest.mark.parametrize("picks", [0, 7, 10, 33])
def test_a_state_goes_on_identically(env_id, picks, rng):
    actions = rng.integers(128, size=(picks + 25, 3))
    envs = gymnasium.make_vec(env_id, 3, max_picks=10).unwrapped
    results = envs.reset(seed=1)
    for action in actions[:picks]:
        results = envs.step(action)
    state = envs.get_state()
    assert len(state["actions"]) == picks % 10
    other = gymnasium.make_vec(env_id, 3, max_picks=10).unwrapped
    assert_same(other.set_state(state)[0], results[0])
    for action in actions[picks:]:
        assert_same(other.step(action), envs.step(action))


def test_a_state_may_hold_the_picks_of_several_episodes(rng):
    actions = rng.integers(128, size=(35, 2))
    envs = gymnasium.make_vec(CONTAINER, 2, max_picks=10).unwrapped
    envs.reset(seed=1)
    start = envs.get_state()
    for action in actions:
        results = envs.step(action)
    other = gymnasium.make_vec(CONTAINER, 2, max_picks=10).unwrapped
    observations, _ = other.set_state(start | {"actions": actions})
    assert_same(observations, results[0])
    assert_same(other.get_state(), envs.get_state())


@pytest.mark.parametrize("env_id", [CONTAINER, HIGHEST])
def test_an_environment_waits_for_the_pick_that_begins_its_episode(env_id, rng):
    actions = rng.integers(128, size=(12, 2))
    envs, other = (gymnasium.make_vec(env_id, 2, max_picks=10).unwrapped for _ in range(2))
    envs.reset(seed=1)
    start = envs.get_state()
    late = actions.copy()
    late[:4, 1] = -1
    observations, _ = other.set_state(start | {"actions": late})
    alone = gymnasium.make_vec(env_id, 1, max_picks=10).unwrapped
    for env, first in ((0, 0), (1, 4)):
        one = {"rng": start["rng"][env : env + 1], "actions": late[first:, env : env + 1]}
        assert_same(alone.set_state(one)[0][0], observations[env])


# --- bad input ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("actions", "error", "message"),
    [
        ([0, 128], ValueError, "actions holds 0 to 128; expected 0 to 127"),
        ([-1, 0], ValueError, "actions holds -1 to 0"),
        ([0], ValueError, r"actions has shape \(1,\); expected \(2,\)"),
        ([0.0, 1.0], TypeError, "actions has dtype float64"),
        (None, TypeError, "actions has dtype object"),
    ],
)
def test_bad_actions_change_nothing(actions, error, message):
    envs = gymnasium.make_vec(CONTAINER, 2)
    envs.reset(seed=0)
    before = envs.unwrapped.get_state()
    with pytest.raises(error, match=message):
        envs.step(actions)
    assert_same(envs.unwrapped.get_state(), before)


@pytest.mark.parametrize(
    ("num_envs", "error"), [(0, ValueError), (2.5, TypeError), (2**16 + 1, ValueError)]
)
@pytest.mark.parametrize("make", [ContainerVectorEnv, HighestItemVectorEnv])
def test_bad_numbers_of_environments_are_refused(make, num_envs, error):
    with pytest.raises(error, match=f"num_envs is {num_envs}"):
        make(num_envs)


@pytest.mark.parametrize(
    ("seed", "error", "message"),
    [
        (-1, ValueError, "seed is -1"),
        (0.5, TypeError, "seed is 0.5"),
        ([1], ValueError, "seed holds 1 seeds; expected 2"),
        ([1, "2"], TypeError, "seed is '2'"),
    ],
)
def test_bad_seeds_leave_the_episodes_as_they_were(seed, error, message):
    envs = gymnasium.make_vec(CONTAINER, 2)
    envs.reset(seed=0)
    before = envs.unwrapped.get_state()
    with pytest.raises(error, match=message):
        envs.reset(seed=seed)
    assert_same(envs.unwrapped.get_state(), before)
    with pytest.raises(ValueError, match="options is {'load': 1}; expected none"):
        envs.reset(options={"load": 1})


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"rng": np.array(["{}", "{}"])}, ValueError, r"state\['rng'\] is .*generator's state"),
        ({"rng": np.array(["{}"])}, ValueError, r"state\['rng'\] has shape \(1,\)"),
        ({"rng": np.array(["{}"] * 3)}, ValueError, r"state\['rng'\] has shape \(3,\)"),
        ({"rng": [["{}"], "{}"]}, ValueError, r"state\['rng'\] is \['{}'\]"),
        ({"rng": ["[" * 100_000] * 2}, ValueError, r"state\['rng'\] is .*generator's state"),
        ({"rng": None}, ValueError, r"state\['rng'\] has shape \(\)"),
        ({"actions": np.full((3, 2), 128)}, ValueError, r"state\['actions'\] holds 128 to 128"),
        ({"actions": np.full((3, 2), -2)}, ValueError, r"state\['actions'\] holds -2 to -2"),
        ({"actions": np.array([[0, 1], [1, -1]])}, ValueError, "holds -1 after a pick"),
        ({"actions": np.array([[1, 0], [1, -1]])}, ValueError, "holds -1 after a pick"),
        ({"actions": np.zeros((3, 4), int)}, ValueError, r"state\['actions'\] has shape \(3, 4\)"),
    ],
)
def test_bad_states_leave_the_episodes_as_they_were(changes, error, message):
    envs = gymnasium.make_vec(CONTAINER, 2).unwrapped
    envs.reset(seed=0)
    before = envs.get_state()
    with pytest.raises(error, match=message):
        envs.set_state(before | changes)
    assert_same(envs.get_state(), before)
    with pytest.raises(ValueError, match="state has no actions"):
        envs.set_state({"rng": before["rng"]})


@pytest.mark.parametrize("call", ["step", "get_state", "action_masks"])
def test_nothing_works_before_reset_or_after_close(call):
    envs = gymnasium.make_vec(CONTAINER, 2).unwrapped
    arguments = [np.zeros(2, int)] if call == "step" else []
    with pytest.raises(ResetNeeded):
        getattr(envs, call)(*arguments)
    envs.reset(seed=0)
    envs.close()
    with pytest.raises(ClosedEnvironmentError):
        getattr(envs, call)(*arguments)
    with pytest.raises(ClosedEnvironmentError):
        envs.reset()
