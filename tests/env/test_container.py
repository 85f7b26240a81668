from functools import partial

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env

from tests.env.comparing import CONTAINER, HIGHEST, assert_same, few_items, make_env
from unload import ContainerEnv, equalize, task
from unload.env import observation
from unload.env.highest_item import GRID
from unload.env.vector import ContainerVectorEnv
from unload.load.boxes import CONTACT_TOLERANCE
from unload.load.picture import snapshot
from unload.load.substacks import build_load


@pytest.mark.parametrize("equalize", [False, True])
@pytest.mark.parametrize("env_id", [CONTAINER, HIGHEST])
def test_check_env(env_id, equalize):
    env = gymnasium.make(env_id, equalize=equalize)
    check_env(env.unwrapped, skip_render_check=True)


def test_reset_shows_the_nearest_items_scaled_blurred_and_sunk_once_per_load(full_load):
    sharp, blurred, given = make_env(position_noise=0.0), make_env(), {"load": full_load}
    seen, info = sharp.reset(seed=0, options=given)
    rows = observation.nearest(full_load.positions)
    assert (sharp.unwrapped.visible == rows).all()
    assert (seen == observation.scale(full_load.positions[rows])).all()
    assert seen.dtype == np.float32 and info["unloaded"] == 0
    blurred.reset(seed=0, options=given)
    blur = blurred.unwrapped.observed_positions() - full_load.positions
    assert blur.std(axis=0) == pytest.approx(0.0005, rel=0.1)
    assert blur.mean(axis=0) == pytest.approx([0, 0, -0.001], abs=1e-4)
    blurred.step(0)
    assert (blurred.unwrapped.observed_positions() - full_load.positions == blur).all()


def test_a_success_removes_the_item_and_shows_the_next():
    env = make_env()
    seen, _ = env.reset(seed=0)
    container = env.unwrapped
    row = int(np.argmax(seen[:, 2]))
    item, visible = int(container.visible[row]), set(container.visible.tolist())
    after, reward, terminated, truncated, info = env.step(row)
    assert (reward, terminated, truncated) == (1.0, False, False)
    assert info["item"] == item and info["unloaded"] == 1
    assert info["distance"] == pytest.approx(0.46, rel=0.02)
    assert not container.physics.present[item]
    now = set(container.visible.tolist())
    assert item not in now and len(now) == 128 and len(now & visible) == 127
    assert not (after == seen).all()


def test_failures_change_nothing_but_the_mask_and_a_success_forgives_them(boxes):
    env, expected = make_env(), np.ones(128, np.int8)
    seen, info = env.reset(seed=0)
    assert_same(info["action_mask"], expected)
    for row in np.argsort(seen[:, 2])[:3]:
        after, reward, _, _, info = env.step(np.array(row))  # as Stable-Baselines3's predict does
        assert reward == -1.0 and info["distance"] < task.LIFT_THRESHOLD and info["unloaded"] == 0
        assert (after == seen).all() and env.unwrapped.physics.present.all()
        expected[row] = 0
        assert_same(info["action_mask"], expected)
        assert_same(env.unwrapped.action_masks(), expected.astype(bool))
        assert info["item_mask"].all()
    _, reward, _, _, info = env.step(int(np.argmax(seen[:, 2])))
    assert reward == 1 and info["action_mask"].tolist() == [1] * 128
    env.reset(options={"load": boxes((1.2, 0.2), (1.2, 0.6))})
    row = env.unwrapped.visible.tolist().index(0)
    assert env.step(row)[4]["action_mask"][row] == 0, "also the first box of a load"


def test_liftable_says_what_would_succeed():
    env = make_env()
    env.reset(seed=0)
    liftable = env.unwrapped.liftable()
    assert liftable.shape == (128,) and liftable.dtype == bool and 0 < liftable.sum() < 128
    for row in range(0, 128, 9):
        env.reset(seed=0)
        assert (env.step(row)[1] == 1) == liftable[row]


def test_the_reward_needs_the_threshold(monkeypatch):
    env = make_env()
    env.reset(seed=0)
    for distance, reward in ((0.2, 1), (0.1999, -1), (0.46, 1), (0.0, -1)):
        monkeypatch.setattr(env.unwrapped.physics, "lift", lambda item, d=distance: d)
        assert env.step(0)[1] == reward
        assert env.unwrapped.liftable().tolist() == [reward == 1] * 128


def test_truncation_after_max_picks():
    env = make_env(max_picks=3)
    env.reset(seed=0)
    assert [env.step(0)[2:4] for _ in range(3)] == [(False, False), (False, False), (False, True)]
    with pytest.raises(ResetNeeded, match="the episode is finished; call reset first"):
        env.unwrapped.step(0)
    env.reset(options={"load": few_items(np.random.default_rng(0), 3)})
    assert [env.step(0)[2:4] for _ in range(3)][-1] == (True, True), "the last item, too"


@pytest.mark.pybullet
def test_drifting_boxes_are_seen_where_they_are():
    """Few enough to be quick, because each of them is simulated."""
    settings = {"physics": "full", "after_pick": "keep", "render_mode": "rgb_array"}
    env = make_env(**settings, stack=lambda rng: build_load(np.zeros((2, 3, 4), int)), max_picks=3)
    env.reset(seed=0)
    container = env.unwrapped
    neat = container.physics.load.positions
    assert (container.observed_positions() == neat).all()
    seen, *_ = env.step(127)
    drift = container.observed_positions() - neat
    assert 0 < np.abs(drift).max() < 0.02
    assert (seen == observation.scale((neat + drift)[container.visible])).all()
    _, reward, *_ = env.step(seen[:, 2].argmax())
    load, present = container.physics.load, container.physics.present
    places = container.observed_positions()
    picture = snapshot(load, present, places)
    assert reward == 1 and (picture == env.render()).all()
    for shown, where in ((np.ones_like(present), places), (present, neat)):
        assert (snapshot(load, shown, where) != picture).any()
    with pytest.raises(ValueError, match="after_pick lets .*expected 'restore'"):
        container.liftable()


def small_env(count: int, **kwargs) -> gymnasium.Env:
    """An environment whose loads hold so many items."""
    return make_env(stack=lambda rng: few_items(rng, count), **kwargs)


@pytest.mark.parametrize("kwargs", [{}, {"equalize": True}, {"equalize": True, "ties": "average"}])
def test_a_container_is_unloaded_to_the_last_item(kwargs):
    env, raw = small_env(135, **kwargs), small_env(135)
    _, info = env.reset(seed=0)
    seen, _ = raw.reset(seed=0)
    container = env.unwrapped
    for left in range(134, -1, -1):
        row = int(np.where(info["item_mask"], seen[:, 2], -2).argmax())
        after, reward, terminated, truncated, info = env.step(row)
        seen, *_ = raw.step(row)
        assert (reward, terminated, truncated) == (1.0, left == 0, False)
        held = np.arange(128) < left
        assert info["item_mask"].dtype == np.int8 and (info["item_mask"] == held).all()
        assert (info["action_mask"] == held).all() and (container.action_masks() == held).all()
        assert (observation.holds_item(seen) == held).all()
        assert (container.visible[:left] >= 0).all() and (container.visible[left:] == -1).all()
        if container.equalize:
            assert (after == equalize(seen, container.ties, present=held)).all()
        else:
            assert (after == seen).all()
        assert (after[left:] == task.PADDING).all() and env.observation_space.contains(after)
    assert info["unloaded"] == 135 and info["item"] >= 0
    with pytest.raises(ResetNeeded, match="the episode is finished"):
        container.step(0)
    assert not container.liftable().any()


def test_a_row_without_an_item_is_a_failed_pick_that_changes_nothing():
    env, untouched = small_env(5), small_env(5)
    seen, info = env.reset(seed=0)
    untouched.reset(seed=0)
    after, reward, terminated, truncated, following = env.step(5)
    assert (reward, terminated, truncated) == (-1.0, False, False)
    assert following["item"] == -1 and following["distance"] == 0.0
    assert (after == seen).all()
    for name in ("action_mask", "item_mask", "unloaded"):
        assert np.array_equal(following[name], info[name])
    assert_same(env.step(0), untouched.step(0))


@pytest.mark.parametrize(
    "kwargs",
    [
        {"physics": "local"},
        pytest.param({"physics": "full"}, marks=pytest.mark.pybullet),
        pytest.param({"physics": "full", "after_pick": "keep"}, marks=pytest.mark.pybullet),
    ],
    ids=str,
)
def test_every_physics_goes_to_the_last_item(kwargs):
    env = small_env(3, **kwargs)
    seen, _ = env.reset(seed=0)
    rewards, terminated = [], False
    while not terminated:
        row = int(np.where(observation.holds_item(seen), seen[:, 2], -2).argmax())
        seen, reward, terminated, _, _ = env.step(row)
        rewards.append(reward)
    assert rewards == [1, 1, 1]


@pytest.mark.parametrize(
    ("action", "error"),
    [(128, ValueError), (-1, ValueError), (np.array([3]), TypeError)],
)
def test_bad_actions_change_nothing(action, error):
    env, untouched = (ContainerEnv(physics="table") for _ in range(2))
    for container in (env, untouched):
        container.reset(seed=0)
    with pytest.raises(error, match="action is .*; expected an integer >= 0 and <= 127"):
        env.step(action)
    assert_same(env.step(5), untouched.step(5))


@pytest.mark.parametrize("make", [ContainerEnv, partial(ContainerVectorEnv, 2)])
def test_loads_of_something_else_or_of_floating_boxes_are_refused(make, boxes):
    tower = boxes((1.2, 0.2), (1.2, 0.6 + 2 * CONTACT_TOLERANCE))
    with pytest.raises(TypeError, match="what stack returned is 'boxes'; expected an unload.Load"):
        make(stack=lambda rng: "boxes").reset(seed=0)
    with pytest.raises(ValueError, match=r"floats in what stack returned, .* 0.4002 m"):
        make(stack=lambda rng: tower).reset(seed=0)
    with pytest.raises(ValueError, match="floats in load"):
        make().reset(options={"load": tower})


def test_only_items_at_the_greatest_height_are_rewarded():
    sharp, blurred = make_env(HIGHEST, position_noise=0.0), make_env(HIGHEST)
    for env in (sharp, blurred):
        seen, info = env.reset(seed=0)
        for number in range(200):
            assert info["action_mask"].dtype == np.int8 and info["action_mask"].all()
            highest = seen[:, 2] > seen[:, 2].max() - 0.01  # levels are 0.028 apart
            row = int(np.flatnonzero(highest == number % 2)[number % 5])
            seen, reward, terminated, _, info = env.step(row)
            assert reward == (1.0 if highest[row] else -1.0) and not terminated


def test_items_are_at_places_of_a_load_blurred_and_nearest_first(full_load):
    places = {tuple(place) for place in np.rint(GRID / 1e-6).astype(int).tolist()}
    items = np.rint(full_load.positions / 1e-6).astype(int).tolist()
    assert all(tuple(item) in places for item in items)
    sharp, _ = make_env(HIGHEST, position_noise=0.0).reset(seed=0)
    blurred, _ = make_env(HIGHEST).reset(seed=0)
    assert {*map(tuple, sharp.tolist())} <= {*map(tuple, observation.scale(GRID).tolist())}
    assert len(np.unique(blurred[:, 2])) > 120 > len(np.unique(sharp[:, 2]))
    for seen in (sharp, blurred):
        distances = observation.distance((seen + 1) / 2 * [7.0, 2.5, 2.5])
        assert (np.diff(distances) > -1e-5).all()
