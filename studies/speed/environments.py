"""Lifts per second of each physics, and picks per second of each environment."""

from collections.abc import Callable

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv

import unload
from studies.speed.timing import best_times
from unload import task
from unload.physics.base import Physics
from unload.physics.full import FullPhysics
from unload.physics.local import LocalPhysics
from unload.physics.table import TablePhysics

CONTAINER = "unload/Container-v0"


def lift_rates(load: unload.Load, full: int = 2, others: int = 100) -> dict[str, float]:
    """Lifts per second in a full container, all known to the table.

    Args:
        load: the container's.
        full: lifts of one round of ``FullPhysics``, which needs seconds for each.
        others: lifts of one round of the others.

    Returns:
        By physics.
    """
    items = np.random.default_rng(0).permutation(len(load)).tolist()
    answering = {"full": FullPhysics(), "local": LocalPhysics(), "table": TablePhysics()}
    counts = {"full": full, "local": others, "table": others}
    for physics in answering.values():
        physics.reset(load)
    times = best_times(
        {name: _lifts(physics, items[: counts[name]]) for name, physics in answering.items()}
    )
    for physics in answering.values():
        physics.close()
    return {name: counts[name] / seconds for name, seconds in times.items()}


def _lifts(physics: Physics, items: list[int]) -> Callable[[], None]:
    def lift_all() -> None:
        for item in items:
            physics.lift(item)

    return lift_all


def pick_rates(num_envs: int = task.NUM_ENVS, picks: int = 500) -> dict[str, float]:
    """Random picks per second of one container, and of many in a loop and in arrays.

    The same episodes are played in each round, all but for their last pick, so that each
    pick carries its share of one reset; after the first round the table knows all lifts.

    Args:
        num_envs: how many containers the last three have.
        picks: of an episode.

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
    times = best_times({name: _episode(env, picks) for name, env in envs.items()})
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
