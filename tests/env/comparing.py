"""Comparison of environments, and stacks that fail."""

from copy import copy

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode

import unload

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


class FailingStack:
    """``stack_load`` that raises ``OSError`` at some of its calls, counted from 1."""

    def __init__(self, *failing: int, walls: int | None = None) -> None:
        self.failing, self.walls, self.calls = failing, walls, 0

    def __call__(self, rng: np.random.Generator) -> unload.Load:
        self.calls += 1
        load = unload.stack_load(rng, self.walls)
        if self.calls in self.failing:
            raise OSError("the stack failed")
        return load


def state_of(env) -> dict:
    """All that the next steps of a container depend on."""
    env = env.unwrapped
    names = ("_observation", "_blur", "_failed", "visible", "_picks", "_unloaded", "_state")
    return {name: copy(getattr(env, name)) for name in names} | {
        "present": env.physics.present.copy(),
        "rng": str(env.np_random.bit_generator.state),
    }
