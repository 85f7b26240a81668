"""The mistakes of trained policies in fresh containers.

    python -m unload.reproduce mistakes

With the mask a policy often tries the same boxes again; without it, its first mistake ends an
episode. Each policy of the paper's cells is applied as it was trained.
"""

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from unload.agent.evaluation import Policy
from unload.agent.greedy import Greedy
from unload.agent.weights import load_policy
from unload.env.vector import ContainerVectorEnv
from unload.reproduce.answer import CELLS, PAPER_CELLS
from unload.reproduce.fingerprint import training_fingerprint
from unload.reproduce.measure import LOADS_SEED, POLICY_LOADS
from unload.reproduce.results import COMMAND, JOBS, keep_all, publish, read_table
from unload.reproduce.survival import before_first_mistake
from unload.reproduce.trained import published_policies
from unload.support import checks, files

NAME, FIRST = "mistakes", "first_mistakes"
MEASURES = ["failed", "first_failed", "repeated", "value_failed"]
OPTIONS = JOBS


def mistakes_data(
    loads: int = POLICY_LOADS,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = -1,
    progress: bool = True,
) -> None:
    """Measure the paper's cells: ``answer/mistakes.csv`` and ``answer/first_mistakes.csv``.

    The first has one row per policy trained with the mask: ``cell``, ``seed``, and what
    ``mistakes`` says of it. The second has one row per policy trained without it and container:
    ``cell``, ``seed``, ``container``, and ``before``, the picks that succeed before the first
    mistake of an episode without the mask, 500 where there is none.

    Args:
        loads: fresh containers for each policy, 500 picks in each.
        folder: of the data; it holds the runs.
        runs_dir: where what has been measured is kept.
        n_jobs: processes, as in joblib.
        progress: show a progress bar.

    Raises:
        ValueError: ``loads`` is not positive, or a run is of training that differs from today's.
        FileNotFoundError: no run has been published.
    """
    checks.integer("loads", loads, 1)
    fingerprint = training_fingerprint()
    policies = published_policies(PAPER_CELLS, fingerprint, folder)
    jobs = []
    for each in policies:
        mask = CELLS[each.cell].mask
        question = {"weights": each.weights, "mask": mask, "loads": loads, "seed": LOADS_SEED}
        jobs.append((question, partial(_measure, each.path, mask, loads)))
    answers = keep_all(Path(runs_dir) / NAME, jobs, n_jobs, progress)
    masked, unmasked = [], []
    for each, answer in zip(policies, answers):
        run = each.cell, each.seed
        if CELLS[each.cell].mask:
            masked.append((*run, *answer.value))
        else:
            unmasked += [(*run, *row) for row in enumerate(answer.value)]
    publish(
        Path(folder) / "answer",
        NAME,
        {
            NAME: pd.DataFrame(masked, columns=["cell", "seed", *MEASURES]),
            FIRST: pd.DataFrame(unmasked, columns=["cell", "seed", "container", "before"]),
        },
        f"{COMMAND} {NAME}",
        {"loads": loads, "loads_seed": LOADS_SEED},
        loads < POLICY_LOADS,
        [answer.record for answer in answers],
        fingerprint,
    )


def _measure(path: str | Path, mask: bool, loads: int) -> list:
    """``MEASURES`` with the mask, or the successes before each container's first mistake."""
    policy = load_policy(path)
    if mask:
        return mistakes(policy, loads, LOADS_SEED)[MEASURES].tolist()
    return before_first_mistake(policy, loads, LOADS_SEED).tolist()


def read_mistakes(folder: str | Path = files.DATA) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The two tables of ``mistakes_data``."""
    columns = {NAME: MEASURES, FIRST: ["container", "before"]}
    first, second = (
        read_table(
            Path(folder) / "answer" / f"{name}.csv",
            f"{COMMAND} {NAME}",
            ["cell", "seed", *others],
        )
        for name, others in columns.items()
    )
    return first, second


def mistakes(policy: Policy, episodes: int, seed: int) -> pd.Series:
    """Let a policy unload fresh containers with the mask, and say what fails.

    A success clears the mask (Sec. III-G), so that a box which has failed may be picked again
    although nothing that lies on it has been taken away.

    Args:
        policy: see ``unload.policies``.
        episodes: containers, side by side.
        seed: of their loads, which are those of ``unload.evaluate``, and of the policy's random
            numbers.

    Returns:
        ``failed``, the share of picks that fail; ``first_failed``, the same of the first picks in
        a state, which are those of an episode and those after a success; ``repeated``, the share
        of failed picks whose box has failed before in the episode, NaN without a failure; and
        ``value_failed``, the median of the values that the network of a trained policy gave to
        the picks that failed, NaN without a failure or a network.

    Raises:
        TypeError, ValueError: an argument is not as described.
    """
    episodes, seed = checks.integer("episodes", episodes, 1), checks.integer("seed", seed, 0)
    rng, rows = np.random.default_rng(seed), np.arange(episodes)
    envs = ContainerVectorEnv(episodes)
    loads = np.random.SeedSequence(seed).generate_state(episodes).tolist()
    observations, infos = envs.reset(seed=loads)
    tried = [set() for _ in rows]  # boxes that have failed
    first, steps, values = np.ones(episodes, bool), [], []
    for _ in range(envs.max_picks - 1):  # the last pick would begin the next episode
        actions = policy(observations, infos["action_mask"].astype(bool), rng)
        boxes = envs.visible[rows, actions].tolist()
        seen = observations
        observations, rewards, *_, infos = envs.step(actions)
        failed = rewards < 0
        if isinstance(policy, Greedy) and failed.any():
            values += policy.values(seen[failed])[np.arange(failed.sum()), actions[failed]].tolist()
        known = [box in each for box, each in zip(boxes, tried)]
        steps.append((failed, first, known))
        for row in np.flatnonzero(failed):
            tried[row].add(boxes[row])
        first = ~failed
    envs.close()
    failed, first, known = map(np.array, zip(*steps))
    return pd.Series(
        {
            "failed": failed.mean(),
            "first_failed": failed[first].mean(),
            "repeated": known[failed].mean() if failed.any() else np.nan,
            "value_failed": np.median(values) if values else np.nan,
        }
    )
