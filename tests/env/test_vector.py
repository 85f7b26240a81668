"""The array environments, against Gymnasium's loop over single ones."""

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from gymnasium.vector import AutoresetMode

import unload
from unload.env.vector import ContainerVectorEnv
from unload.physics.table import LiftTable

CONTAINER, HIGHEST = "unload/Container-v0", "unload/HighestItem-v0"


def make_pair(env_id: str, num_envs: int, **kwargs):
    """The array environment, and single ones side by side."""
    single = {"physics": "table"} if env_id == CONTAINER else {}
    side_by_side = gymnasium.make_vec(
        env_id,
        num_envs,
        vectorization_mode="sync",
        vector_kwargs={"autoreset_mode": AutoresetMode.SAME_STEP},
        **single,
        **kwargs,
    )
    return gymnasium.make_vec(env_id, num_envs, **kwargs), side_by_side


def assert_same(one, other) -> None:
    """Equal types, keys, dtypes, shapes and bits, all the way down."""
    assert type(one) is type(other)
    if isinstance(one, dict):
        assert one.keys() == other.keys()
        for name in one:
            assert_same(one[name], other[name])
    elif isinstance(one, (tuple, list)) or getattr(one, "dtype", None) == np.dtype(object):
        assert len(one) == len(other)
        for a, b in zip(one, other):
            assert_same(a, b)
    elif isinstance(one, np.ndarray):
        assert one.dtype == other.dtype and one.shape == other.shape
        assert one.tobytes() == other.tobytes()
    else:
        assert one == other


def play_both(env_id: str, num_envs: int, steps: int, seed: int = 0, **kwargs) -> np.ndarray:
    """Step both environments with the same actions, some random and some sensible.

    Returns:
        (steps, 2, num_envs) bool, where episodes were terminated, and where truncated.
    """
    array, side_by_side = make_pair(env_id, num_envs, **kwargs)
    rng = np.random.default_rng(seed)
    results = array.reset(seed=seed)
    assert_same(results, side_by_side.reset(seed=seed))
    ends = []
    for _ in range(steps):
        actions = rng.integers(128, size=num_envs)
        sensible = rng.random(num_envs) < 0.4
        actions[sensible] = results[0][sensible, :, 2].argmax(axis=1)
        results = array.step(actions)
        assert_same(results, side_by_side.step(actions))
        ends.append(results[2:4])
    array.close()
    side_by_side.close()
    return np.array(ends)


def test_64_containers_for_whole_episodes_and_beyond():
    play_both(CONTAINER, 64, 520, equalize=True)


@pytest.mark.parametrize("env_id", [CONTAINER, HIGHEST])
@pytest.mark.parametrize(
    "kwargs",
    [
        {},
        {"equalize": True},
        {"equalize": True, "ties": "average"},
        {"equalize": True, "position_noise": 0.0},
    ],
    ids=str,
)
def test_every_setting_through_several_episodes(env_id, kwargs):
    play_both(env_id, 3, 60, seed=5, max_picks=25, **kwargs)


def test_loads_of_several_sizes_and_kinds():
    def stack(rng):
        return unload.stack_load(rng, walls=int(rng.integers(3, 16)))

    play_both(CONTAINER, 4, 45, max_picks=15, stack=stack)


@pytest.fixture
def mixed_stack(few_items):
    """Loads of 1 to 150 items."""
    return lambda rng: few_items(rng, int(rng.choice([1, 2, 5, 40, 127, 128, 129, 150])))


@pytest.mark.parametrize(
    "kwargs",
    [{}, {"equalize": True}, {"equalize": True, "ties": "average"}],
    ids=str,
)
def test_episodes_that_end_at_different_steps(mixed_stack, kwargs):
    ends = play_both(CONTAINER, 5, 600, seed=2, max_picks=150, stack=mixed_stack, **kwargs)
    terminated, truncated = ends.transpose(1, 0, 2)
    assert terminated.any() and truncated.any()
    together = (terminated | truncated).sum(axis=1)
    assert {0, 1} < set(together.tolist())


def test_episodes_that_end_at_once(few_items):
    ends = play_both(CONTAINER, 3, 20, max_picks=2, stack=lambda rng: few_items(rng, 1))
    assert ends[:, 0].any() and ends[:, 1].any()
    together = ends.any(axis=1).sum(axis=1)
    assert 3 in together and {1, 2} & set(together.tolist())


def test_a_whole_load_to_the_last_item():
    envs, side_by_side = make_pair(CONTAINER, 2, equalize=True, max_picks=2000)
    results = envs.reset(seed=0)
    side_by_side.reset(seed=0)
    ended = np.zeros(2, bool)
    while not ended.all():
        heights = np.where(results[-1]["item_mask"], results[0][..., 2], -2)
        results = envs.step(heights.argmax(axis=1))
        assert_same(results, side_by_side.step(heights.argmax(axis=1)))
        ended |= results[2]
        for number in np.flatnonzero(results[2]):
            final = results[4]["final_info"]
            assert final["unloaded"][number] >= 800 and not final["item_mask"][number].any()
            assert (results[4]["final_obs"][number] == -1).all()


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


def test_visible_items_and_masks():
    envs, side_by_side = make_pair(CONTAINER, 3)
    envs.reset(seed=0)
    side_by_side.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(20):
        actions = rng.integers(128, size=3)
        envs.step(actions)
        side_by_side.step(actions)
    for number, env in enumerate(side_by_side.envs):
        assert (envs.unwrapped.visible[number] == env.unwrapped.visible).all()
        assert (envs.unwrapped.action_masks()[number] == env.unwrapped.action_masks()).all()


def test_unknown_lifts_are_asked_once_and_remembered(monkeypatch):
    table = LiftTable()
    monkeypatch.setattr("unload.env.vector.shared_table", lambda: table)
    actions = np.random.default_rng(0).integers(128, size=(40, 2))
    runs = []
    for _ in range(2):
        envs = gymnasium.make_vec(CONTAINER, 2, max_picks=40)
        envs.reset(seed=3)
        runs.append([envs.step(action)[1].tolist() for action in actions])
        if len(runs) == 1:
            assert len(table) > 10
            monkeypatch.setattr("unload.physics.table.lift", None)
    assert runs[0] == runs[1]


def test_seeds():
    envs = gymnasium.make_vec(CONTAINER, 2)
    first, _ = envs.reset(seed=4)
    listed, _ = envs.reset(seed=[5, 4])
    assert (first == listed[::-1]).all()
    following, _ = envs.reset()
    assert not (following == listed).all()
    kept, _ = envs.reset(seed=[None, 4])
    assert (kept[1] == first[0]).all()
    unseeded, _ = gymnasium.make_vec(CONTAINER, 2).reset()
    assert not (unseeded[0] == unseeded[1]).all()


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


@pytest.mark.parametrize("picks", [0, 1, 30, 100, 333])
@pytest.mark.parametrize("max_picks", [40, 500])
def test_a_state_in_different_stages_goes_on_identically(mixed_stack, picks, max_picks, rng):
    def make():
        return gymnasium.make_vec(CONTAINER, 4, max_picks=max_picks, stack=mixed_stack).unwrapped

    def act():
        actions = rng.integers(128, size=4)
        return np.where(rng.random(4) < 0.5, 0, actions)

    envs, other = make(), make()
    results = envs.reset(seed=1)
    for _ in range(picks):
        results = envs.step(act())
    state = envs.get_state()
    assert state["actions"].shape[0] <= min(picks, max_picks)
    if picks >= 100:
        assert (state["actions"][0] == -1).any() and (state["actions"][0] >= 0).any()
    observations, infos = other.set_state(state)
    assert_same(observations, results[0])
    for name in ("action_mask", "item_mask", "unloaded"):
        assert_same(infos[name], results[-1][name])
    assert_same(other.get_state(), state)
    for _ in range(200):
        actions = act()
        assert_same(other.step(actions), envs.step(actions))
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
    ("kwargs", "error", "message"),
    [
        ({"num_envs": 0}, ValueError, "num_envs is 0"),
        ({"num_envs": 2.5}, TypeError, "num_envs is 2.5"),
        ({"physics": "local"}, ValueError, "physics is 'local'; expected one of 'table'"),
        ({"equalize": 1}, TypeError, "equalize is 1"),
        ({"ties": "coin"}, ValueError, "ties is 'coin'"),
        ({"max_picks": 0}, ValueError, "max_picks is 0"),
        ({"position_noise": -1}, ValueError, "position_noise is -1"),
        ({"stack": 3}, TypeError, "stack is 3"),
        ({"render_mode": "human"}, ValueError, "render_mode is 'human'"),
    ],
)
def test_bad_settings_are_refused(kwargs, error, message):
    with pytest.raises(error, match=message):
        ContainerVectorEnv(**kwargs)


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
        ({"actions": np.full((3, 2), 128)}, ValueError, r"state\['actions'\] holds 128 to 128"),
        ({"actions": np.full((3, 2), -2)}, ValueError, r"state\['actions'\] holds -2 to -2"),
        ({"actions": np.array([[0, 1], [1, -1]])}, ValueError, "holds -1 after a pick"),
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


def test_a_stack_of_something_else_is_refused():
    envs = gymnasium.make_vec(CONTAINER, 2, stack=lambda rng: "boxes")
    with pytest.raises(TypeError, match="load is 'boxes'; expected an unload.Load"):
        envs.reset(seed=0)
