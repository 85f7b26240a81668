"""The lift table: lifts that fresh containers commonly meet.

    python -m studies lifts

An empty table is filled by playing with varied policies: the highest or the nearest item,
mixed with random ones to various degrees, or the item that is farthest in some direction; and
with random picks far longer, because these leave the most situations behind.
"""

import sys
from collections.abc import Callable
from functools import partial
from itertools import product

import numpy as np
from tqdm import tqdm

from studies.results import COMMAND, measured, publish
from unload import task
from unload.agent import policies
from unload.env.vector import ContainerVectorEnv
from unload.physics.bullet import ENGINES
from unload.physics.table import LIFTS_FILE, LiftTable, TablePhysics

EPISODES, SEED = 12, 0  # of 64 containers, for each policy
RANDOM_SHARE = 40  # times as many episodes of random picks


def lift_data() -> None:
    """Fill the table that comes with the package, also where there is none yet."""
    settings = {
        "episodes of 64 containers per taste": EPISODES,
        "of random picks": RANDOM_SHARE * EPISODES,
        "seed": SEED,
    }
    filled = measured(_fill)
    table = LiftTable(ENGINES[0])
    table.entries = filled.value["digests"], filled.value["micrometres"]
    table.save(LIFTS_FILE)
    settings["lifts"] = len(table)
    publish(LIFTS_FILE.with_suffix(""), {}, f"{COMMAND} lifts", settings, [filled])


def _fill() -> dict[str, np.ndarray]:
    """The entries of an empty table that was filled by playing."""
    rng = np.random.default_rng(SEED)
    table = LiftTable(ENGINES[0])  # the reference, wherever this runs
    envs = ContainerVectorEnv(task.NUM_ENVS, TablePhysics(table, exact=True))
    jobs = list(product(range(EPISODES), _filling_policies(rng)))
    for _, policy in tqdm(jobs, unit="episode", ncols=100, file=sys.stdout):
        observations, infos = envs.reset(seed=int(rng.integers(2**31)))
        for _ in range(task.MAX_PICKS):
            actions = policy(observations, infos["action_mask"], rng)
            observations, _, _, _, infos = envs.step(actions)
    return dict(zip(("digests", "micrometres"), table.entries))


def _filling_policies(rng: np.random.Generator) -> list[Callable]:
    """Policies that lead a container through very different states."""
    return [
        *[policies.random] * RANDOM_SHARE,
        *(
            mixed(favourite, share)
            for favourite in (policies.highest, policies.nearest)
            for share in (0.0, 0.1, 0.3, 0.6)
        ),
        *(mixed(partial(_farthest, direction=rng.normal(size=3)), 0.2) for _ in range(12)),
    ]


def mixed(favourite: Callable, share: float) -> Callable:
    """A policy that picks at random with probability ``share``, and as ``favourite`` else."""

    def policy(observations, masks, rng):
        at_random = rng.random(len(masks)) < share
        actions = np.empty(len(masks), np.int64)
        for rows, chosen in ((at_random, policies.random), (~at_random, favourite)):
            if rows.any():
                actions[rows] = chosen(observations[rows], masks[rows], rng)
        return actions

    return policy


def _farthest(observations, masks, rng, direction: np.ndarray) -> np.ndarray:
    """The policy that picks the item farthest in a direction, (3,) in scaled positions."""
    return np.where(masks, observations @ direction, -np.inf).argmax(axis=1)
