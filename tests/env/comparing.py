"""Environments and loads of few items, and comparison to the bit."""

from functools import partial

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from unload import Load, plain, stack_load, task
from unload.env import observation

CONTAINER, HIGHEST = "unload/Container-v0", "unload/HighestItem-v0"


def few_items(rng: np.random.Generator, count: int) -> Load:
    """The items of a random load that are farthest from the entrance."""
    load = stack_load(rng)
    last = np.sort(observation.nearest(load.positions, len(load))[-count:])
    return Load(load.positions[last], load.sizes[last], load.packages[last], load.walls[last])


def make_env(env_id: str = CONTAINER, **kwargs) -> gymnasium.Env:
    """``gymnasium.make``, with a table of lifts if no physics is named."""
    physics = {"physics": "table"} if env_id == CONTAINER else {}
    return gymnasium.make(env_id, **physics | kwargs)


def make_pair(env_id: str, num_envs: int, autoreset_mode=AutoresetMode.SAME_STEP, **kwargs):
    """The array environment, and plain ones side by side in Gymnasium's loop."""
    single = partial(plain.Container if env_id == CONTAINER else plain.HighestItem, **kwargs)
    array = gymnasium.make_vec(env_id, num_envs, autoreset_mode=autoreset_mode, **kwargs)
    return array, SyncVectorEnv([single] * num_envs, autoreset_mode=autoreset_mode)


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


def play_both(
    env_id: str, num_envs: int, steps: int, seed: int = 0, options: dict | None = None, **kwargs
) -> np.ndarray:
    """Step both environments with the same actions, some random and some sensible.

    Returns:
        (steps, 2, num_envs) bool, where episodes were terminated, and where truncated.
    """
    array, side_by_side = make_pair(env_id, num_envs, **kwargs)
    assert array.metadata["autoreset_mode"] is side_by_side.metadata["autoreset_mode"]
    rng = np.random.default_rng(seed)
    results = array.reset(seed=seed, options=options)
    assert_same(results, side_by_side.reset(seed=seed, options=options))
    ends = []
    for _ in range(steps):
        actions = rng.integers(128, size=num_envs)
        sensible = rng.random(num_envs) < 0.4
        actions[sensible] = results[0][sensible, :, 2].argmax(axis=1)
        results = array.step(actions)
        assert_same(results, side_by_side.step(actions))
        ends.append(results[2:4])
        over = np.logical_or(*ends[-1])
        if array.metadata["autoreset_mode"] is AutoresetMode.DISABLED and over.any():
            # The seed is for those that begin, and half of the time it is not given.
            options = {"reset_mask": over}
            given = {"seed": int(rng.integers(9))} if rng.random() < 0.5 else {}
            begun = array.reset(**given, options=dict(options))
            assert_same(begun, side_by_side.reset(**given, options=options))
            results = begun
    if env_id == CONTAINER:
        visible = np.array([env.visible for env in side_by_side.envs])
        lifts = [list(map(env.lift, env.visible.tolist())) for env in side_by_side.envs]
        assert (array.unwrapped.visible == visible).all()
        assert_same(array.liftable(), np.array(lifts) >= task.LIFT_THRESHOLD)
        masks = [env.info()["action_mask"] for env in side_by_side.envs]
        assert_same(array.action_masks(), np.array(masks).astype(bool))
    assert_same(array.reset(), side_by_side.reset())
    return np.array(ends)


def mixed_stack(rng: np.random.Generator) -> Load:
    """A load of 1 to 150 items."""
    return few_items(rng, int(rng.choice([1, 2, 5, 40, 127, 128, 129, 150])))
