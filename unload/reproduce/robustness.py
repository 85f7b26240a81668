"""Policies compared with every box simulated.

    python -m unload.reproduce robustness

In ``full`` physics all boxes are free to move. With ``after_pick="restore"`` they are put
back after every pick; with ``"keep"`` they stay where the pick has left them. They drift,
and a box on which nothing lies may be jammed between its neighbours. ``"table"`` stands for
the lift table, in whose loads only the picked box moves: what drift costs is seen beside it.
"""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from unload.agent.evaluation import Policy, success_rate
from unload.env.container import ContainerEnv
from unload.load.boxes import Load
from unload.load.substacks import FRONT_WALLS, front_walls, stack_load
from unload.physics.bullet import SETTINGS
from unload.physics.situation import Surroundings
from unload.reproduce import comparison
from unload.reproduce.comparison import COMPARED, find_policy, policies_fingerprint, policy_digest
from unload.reproduce.results import COMMAND, keep_all, publish
from unload.support import checks, files

NAME = "robustness"
EPISODES, PICKS = 10, 100
SEED = 2000  # of the loads; no other data uses it
LIFTED_BY = ("table", "keep", "restore")
RESTORED = ("recommended",)  # for the others every lift would be the table's
OPTIONS = comparison.OPTIONS


def robustness_data(
    names: Sequence[str] = COMPARED,
    episodes: int = EPISODES,
    picks: int = PICKS,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = 1,
    progress: bool = True,
) -> pd.DataFrame:
    """Let policies unload the same containers; write ``robustness.csv`` and its provenance.

    By the lift table and with boxes kept where they are for every policy, and with boxes
    restored for the recommended one. A simulated episode takes minutes. Each one that is
    finished is kept, so that a run that was stopped goes on.

    Args:
        names: of the policies.
        episodes: containers per policy and ``after_pick``; only their front walls are
            simulated, see ``front_walls``.
        picks: per container, at most 100.
        folder: of the data; it holds the learned policies.
        runs_dir: where finished episodes are kept.
        n_jobs: processes, as in joblib.
        progress: show a progress bar.

    Returns:
        One row per policy, ``after_pick`` and episode, with the columns of ``play``.

    Raises:
        FileNotFoundError: a policy's file is absent; the message names it.
        TypeError, ValueError: an argument is not as described.
    """
    checks.integer("episodes", episodes, 1)
    checks.integer("picks", picks, 1, PICKS)
    policies_by_name = {name: find_policy(name, folder) for name in names}
    weights = {name: policy_digest(name, folder) for name in names}
    seeds = np.random.SeedSequence(SEED).generate_state(episodes).tolist()
    containers = [
        {"policy": name, "after_pick": after_pick, "episode": episode}
        for after_pick in LIFTED_BY
        for name in policies_by_name
        if after_pick != "restore" or name in RESTORED
        for episode in range(episodes)
    ]
    jobs = []
    for container in containers:
        name, after_pick, episode = container.values()
        size = {"seed": seeds[episode], "picks": picks, "walls": FRONT_WALLS}
        question = container | size | {"weights": weights[name], "settings": SETTINGS}
        compute = partial(
            play, policies_by_name[name], after_pick, seeds[episode], picks, stack=front_load
        )
        jobs.append((question, compute))
    answers = keep_all(Path(runs_dir) / NAME, jobs, n_jobs, progress)
    frame = pd.DataFrame([one | answer.value for one, answer in zip(containers, answers)])
    settings = {
        "policies": weights,
        "after_pick": LIFTED_BY,
        "episodes": episodes,
        "picks": picks,
        "seed": SEED,
        "front walls": FRONT_WALLS,
    }
    publish(
        folder,
        NAME,
        {NAME: frame},
        f"{COMMAND} {NAME} --policies {' '.join(weights)}",
        settings,
        episodes < EPISODES or picks < PICKS or set(weights) < set(COMPARED),
        [answer.record for answer in answers],
        policies_fingerprint(names, folder),
    )
    return frame


def play(
    policy: Policy,
    after_pick: str,
    seed: int,
    picks: int = PICKS,
    mask: bool = True,
    stack: Callable[[np.random.Generator], Load] = stack_load,
) -> dict[str, float]:
    """Let a policy unload one container.

    Args:
        policy: see ``unload.policies``.
        after_pick: ``"keep"`` or ``"restore"`` in ``full`` physics, see ``FullPhysics``;
            ``"table"`` for the lift table.
        seed: of the load and of the policy's random numbers.
        picks: how many.
        mask: whether items that failed since the last success are masked.
        stack: makes the load, see ``ContainerEnv``.

    Returns:
        ``success_rate``, ``unloaded``, ``deadlocked`` and ``longest_deadlock`` as in
        ``evaluate``; ``free`` and ``jammed``, the shares of picks at items on which nothing
        rested in the neat load but what has been unloaded since, and of those that failed
        nevertheless; ``median_displacement`` and ``max_displacement`` of the boxes that are
        left, in m, at the end.

    Raises:
        TypeError, ValueError: an argument is not as described, or the load does not hold
            more items than ``picks``.
    """
    checks.one_of("after_pick", after_pick, LIFTED_BY)
    checks.boolean("mask", mask)
    rng = np.random.default_rng([checks.integer("seed", seed, 0)])
    rewards, deadlocked, free = [], [], []
    longest = stuck = 0
    lifts = ("table",) if after_pick == "table" else ("full", after_pick)
    env = ContainerEnv(*lifts, max_picks=picks, stack=stack)
    try:
        observation, info = env.reset(seed=seed)
        physics = env.physics
        if len(physics.load) <= picks:
            raise ValueError(f"stack made {physics.load}; expected more than picks={picks} items")
        around = Surroundings(physics.load, physics.present)
        for _ in range(picks):
            allowed = info["action_mask" if mask else "item_mask"]
            action = int(policy(observation[np.newaxis], allowed[np.newaxis], rng)[0])
            deadlocked.append(info["action_mask"][action] == 0)
            stuck = stuck + 1 if deadlocked[-1] else 0
            longest = max(longest, stuck)
            item = int(env.visible[action])
            free.append(item >= 0 and not around.on_top(item))
            observation, reward, _, _, info = env.step(action)
            rewards.append(reward)
        moved = np.linalg.norm(physics.positions() - physics.load.positions, axis=1)
        moved = moved[physics.present]
    finally:
        env.close()
    failed = np.array(rewards) < 0
    return {
        "success_rate": success_rate(rewards),
        "unloaded": int((~failed).sum()),
        "deadlocked": float(np.mean(deadlocked)),
        "longest_deadlock": longest,
        "free": float(np.mean(free)),
        "jammed": float(np.mean(free & failed)),
        "median_displacement": float(np.median(moved)),
        "max_displacement": float(moved.max()),
    }


def front_load(rng: np.random.Generator) -> Load:
    """The front walls of a random load."""
    return front_walls(stack_load(rng))
