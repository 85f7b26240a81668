"""The lift table: lifts that fresh containers commonly meet.

    python -m unload.reproduce lifts

An empty table is filled by playing with varied policies: the highest or the nearest item,
mixed with random ones to various degrees, or the item that is farthest in some direction; and
with random picks far longer, because these leave the most situations behind.
"""

import sys
from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path

import gymnasium
import numpy as np
from tqdm import tqdm

from unload import task
from unload.agent import policies
from unload.physics.bullet import SETTINGS
from unload.physics.table import LiftTable
from unload.reproduce.results import COMMAND, kept, publish
from unload.support import checks, files

EPISODES = 12
RANDOM_SHARE = 40  # episodes of random picks per episode of each other policy


def lift_data(
    episodes: int = EPISODES,
    seed: int = 0,
    folder: str | Path = files.SHIPPED,
    runs_dir: str | Path = files.RUNS,
    progress: bool = True,
) -> None:
    """Write ``lifts.npz``, see ``unload.physics.table.LiftTable``.

    Args:
        episodes: of 64 containers for each of the 20 policies, and ``RANDOM_SHARE`` times as
            many of random picks.
        seed: of the episodes.
        folder: of the table.
        runs_dir: where the table is kept, not to be computed again.
        progress: show a progress bar.
    """
    settings = {
        "episodes of 64 containers per taste": checks.integer("episodes", episodes, 1),
        "of random picks": RANDOM_SHARE * episodes,
        "seed": checks.integer("seed", seed, 0),
    }
    runs_dir = Path(runs_dir) / "lifts"
    path = runs_dir / f"{episodes}_episodes_seed_{seed}.npz"
    question = settings | {"physics": SETTINGS}
    _, record = kept(runs_dir, question, partial(_fill, path, episodes, seed, progress))
    table = LiftTable.load(path)
    table.save(Path(folder) / "lifts.npz")
    settings["lifts"] = len(table)
    publish(folder, "lifts", {}, f"{COMMAND} lifts", settings, episodes < EPISODES, [record])


def _fill(path: Path, episodes: int, seed: int, progress: bool) -> None:
    """Fill an empty table by playing, and save it."""
    rng = np.random.default_rng(seed)
    envs = gymnasium.make_vec("unload/Container-v0", task.NUM_ENVS).unwrapped
    envs.table = LiftTable()
    jobs = list(product(range(episodes), _filling_policies(rng)))
    for _, policy in tqdm(jobs, unit="episode", disable=not progress, ncols=100, file=sys.stdout):
        observations, infos = envs.reset(seed=int(rng.integers(2**31)))
        for _ in range(task.MAX_PICKS):
            actions = policy(observations, infos["action_mask"], rng)
            observations, _, _, _, infos = envs.step(actions)
    envs.close()
    envs.table.save(path)


def _filling_policies(rng: np.random.Generator) -> list[Callable]:
    """Policies that lead a container through very different states."""
    return [
        *[policies.random] * RANDOM_SHARE,
        *(
            policies.mixed(favourite, share)
            for favourite in (policies.highest, policies.nearest)
            for share in (0.0, 0.1, 0.3, 0.6)
        ),
        *(policies.mixed(_farthest(rng.normal(size=3)), 0.2) for _ in range(12)),
    ]


def _farthest(direction: np.ndarray) -> Callable:
    """A policy that picks the item farthest in a direction, (3,) in scaled positions."""

    def policy(observations, masks, rng):
        return np.where(masks, observations @ direction, -np.inf).argmax(axis=1)

    return policy
