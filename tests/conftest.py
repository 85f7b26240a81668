"""Fixtures that several test modules share: loads and environments."""

from collections.abc import Callable

import gymnasium
import numpy as np
import pytest
import torch
from hypothesis import settings

import unload
from unload.env import observation

torch.set_num_threads(1)
# The same examples every time, however slow the machine is, and none kept from run to run.
settings.register_profile("repeatable", derandomize=True, deadline=None, database=None)
settings.load_profile("repeatable")


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


@pytest.fixture(scope="session")
def full_load() -> unload.Load:
    """A load of the paper: 12 walls."""
    return unload.stack_load(np.random.default_rng(0))


@pytest.fixture(scope="session")
def small_load() -> unload.Load:
    """A load of one wall, for tests that simulate every box."""
    return unload.stack_load(np.random.default_rng(0), walls=1)


@pytest.fixture(scope="session")
def few_items() -> Callable[[np.random.Generator, int], unload.Load]:
    """``few_items(rng, count)``: the items of a random load that are farthest from the entrance."""

    def build(rng: np.random.Generator, count: int) -> unload.Load:
        load = unload.stack_load(rng)
        last = np.sort(observation.nearest(load.positions, len(load))[-count:])
        return unload.Load(
            load.positions[last], load.sizes[last], load.packages[last], load.walls[last]
        )

    return build


@pytest.fixture
def boxes() -> Callable[..., unload.Load]:
    """``boxes((y, z), ...)``: a load of cubes of 0.4 m in the plane x = 3.5 m."""

    def build(*centres: tuple[float, float]) -> unload.Load:
        positions = np.array([(3.5, y, z) for y, z in centres])
        labels = np.zeros(len(centres), dtype=int)
        return unload.Load(positions, np.full((len(centres), 3), 0.4), labels, labels)

    return build


@pytest.fixture(scope="session")
def make_env() -> Callable[..., gymnasium.Env]:
    """``make_env(id, **kwargs)``: ``gymnasium.make``, with a table of lifts if none is named."""

    def make(env_id: str = "unload/Container-v0", **kwargs) -> gymnasium.Env:
        if env_id == "unload/Container-v0":
            kwargs.setdefault("physics", "table")
        return gymnasium.make(env_id, **kwargs)

    return make
