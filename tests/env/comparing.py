"""Comparison of environments, and stacks that fail."""

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode

CONTAINER, HIGHEST = "unload/Container-v0", "unload/HighestItem-v0"


def make_pair(env_id: str, num_envs: int, autoreset_mode=AutoresetMode.SAME_STEP, **kwargs):
    """The array environment, and single ones side by side."""
    single = {"physics": "table"} if env_id == CONTAINER else {}
    side_by_side = gymnasium.make_vec(
        env_id,
        num_envs,
        vectorization_mode="sync",
        vector_kwargs={"autoreset_mode": autoreset_mode},
        **single,
        **kwargs,
    )
    array = gymnasium.make_vec(env_id, num_envs, autoreset_mode=autoreset_mode, **kwargs)
    return array, side_by_side


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
