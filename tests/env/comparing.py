"""Environments and loads of few items, and comparison to the bit."""

from functools import partial

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from unload import Load, plain, stack_load
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
