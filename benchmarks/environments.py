"""Picks per second of the environments, with random actions."""

import time
import tracemalloc
from collections.abc import Callable

import gymnasium
import numpy as np
import pandas as pd
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv

from benchmarks.timing import best_times
from unload import task

CONTAINER = "unload/Container-v0"
LOADS = 64  # different ones


def pick_rates(
    num_envs: int = task.NUM_ENVS, picks: int = 500, rounds: int = 3
) -> dict[str, float]:
    """Picks per second of one container, and of many in a loop and in arrays.

    The same episodes are played in each round, all but for their last pick, so that each
    pick carries its share of one reset; after the first round the table knows all lifts.

    Args:
        num_envs: how many containers the last three have.
        picks: of an episode.
        rounds: see ``best_times``.

    Returns:
        By environment.
    """

    def one(physics: str) -> gymnasium.Env:
        return gymnasium.make(CONTAINER, physics=physics, max_picks=picks)

    def loop(physics: str) -> SyncVectorEnv:
        makers = [lambda: one(physics)] * num_envs
        return SyncVectorEnv(makers, autoreset_mode=AutoresetMode.SAME_STEP)

    def arrays(equalize: bool) -> VectorEnv:
        return gymnasium.make_vec(CONTAINER, num_envs, max_picks=picks, equalize=equalize)

    envs = {
        "one container, local": one("local"),
        "one container, table": one("table"),
        f"{num_envs} containers in a loop, table": loop("table"),
        f"{num_envs} in arrays": arrays(False),
        f"{num_envs} in arrays, equalized": arrays(True),
    }
    counts = {name: (picks - 1) * getattr(env, "num_envs", 1) for name, env in envs.items()}
    times = best_times({name: _episode(env, picks) for name, env in envs.items()}, rounds)
    for env in envs.values():
        env.close()
    return {name: counts[name] / seconds for name, seconds in times.items()}


def _episode(env: gymnasium.Env | VectorEnv, picks: int) -> Callable[[], None]:
    shape = (picks - 1, getattr(env, "num_envs", 1))
    actions = np.random.default_rng(0).integers(task.N_VISIBLE, size=shape)
    if not isinstance(env, VectorEnv):
        actions = actions[:, 0].tolist()

    def play() -> None:
        env.reset(seed=0)
        for action in actions:
            env.step(action)

    return play


def container_costs(
    counts: tuple[int, ...] = (1, 4, 16, 64, 256, 1024, 4096), picks: int = 500, rounds: int = 2
) -> pd.DataFrame:
    """What a pick costs in the array environment, by the number of containers.

    The loads are 64 different ones, repeated if there are more containers, so that none
    of them brings lifts that the table has not met.

    Args:
        counts: numbers of containers.
        picks: of an episode.
        rounds: the least time of so many is taken.

    Returns:
        One row per number: ``containers``; ``step_ns`` and ``reset_ns``, time per pick of
        stepping and of filling the container once per episode; ``picks_per_s`` of both
        together; ``memory_mb``, of the environment after a reset.
    """
    _play_episode(_make(LOADS, picks), picks)  # the table meets all lifts
    rows = []
    for containers in counts:
        tracemalloc.start()
        envs = _make(containers, picks)
        envs.reset(seed=_seeds(containers))
        memory, _ = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        times = np.min([_play_episode(envs, picks) for _ in range(rounds)], axis=0)
        envs.close()
        reset_ns, step_ns = times / containers / [picks, picks - 1] * 1e9
        rows.append(
            {
                "containers": containers,
                "step_ns": step_ns,
                "reset_ns": reset_ns,
                "picks_per_s": 1e9 / (step_ns + reset_ns),
                "memory_mb": memory / 1e6,
            }
        )
    return pd.DataFrame(rows)


def _make(containers: int, picks: int) -> VectorEnv:
    return gymnasium.make_vec(CONTAINER, containers, max_picks=picks, equalize=True)


def _seeds(containers: int) -> list[int]:
    return [number % LOADS for number in range(containers)]


def _play_episode(envs: VectorEnv, picks: int) -> tuple[float, float]:
    """Seconds for the reset and for all picks of an episode but its last, which resets."""
    actions = np.random.default_rng(0).integers(task.N_VISIBLE, size=(picks - 1, LOADS))
    actions = actions[:, _seeds(envs.num_envs)]
    start = time.perf_counter()
    envs.reset(seed=_seeds(envs.num_envs))
    filled = time.perf_counter()
    for row in actions:
        envs.step(row)
    return filled - start, time.perf_counter() - filled
