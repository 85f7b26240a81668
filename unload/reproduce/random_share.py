"""Training with a constant share of random picks.

    python -m unload.reproduce random-share

``random_picks.fit`` fits a network to random picks that it has no part in. Here the network
shapes the containers that it learns in, by the picks that are not random; or a teacher does.
"""

from collections.abc import Mapping
from functools import partial
from itertools import product
from pathlib import Path
from typing import NamedTuple

import gymnasium
import numpy as np
import pandas as pd
import torch

from unload import task
from unload.agent.dqn import DQN
from unload.agent.evaluation import Policy, evaluate
from unload.agent.greedy import greedy_actions
from unload.agent.policies import random
from unload.agent.replay import ReplayBuffer
from unload.network.peq import PEQNetwork
from unload.reproduce.fingerprint import training_fingerprint
from unload.reproduce.random_picks import LOADS_SEED, TRANSFORMS, greedy
from unload.reproduce.results import COMMAND, JOBS, keep_all, publish, read_table
from unload.support import checks, files

REMEMBER = ("all", "random")
NAME = "random_share"
SIZE = {"picks": 96_000, "loads": 32}  # of a training, and fresh containers that judge it
SEED_COUNT = 10
NOISY = "noisy ranks"  # the paper's features
HALF = {"features": NOISY, "epsilon": 0.5, "mask": False, "remember": "all"}
QUESTIONS: list[dict] = [
    *(HALF | {"epsilon": epsilon} for epsilon in (1.0, 0.9, 0.5)),
    *(
        HALF | {"features": features}
        for features in (
            "positions",
            "stretched positions",
            "tied ranks",
            "noisy ranks of x",
            "noisy ranks of z",
        )
    ),
    HALF | {"mask": True},
    HALF | {"remember": "random"},
]
COLUMNS = [*HALF, "seed", "msr_mask", "msr_no_mask"]
HEIGHTS = ["epsilon", "seed", "rank", "tried", "succeeded"]
OPTIONS = JOBS


class Learned(NamedTuple):
    """Result of ``learn``.

    Attributes:
        policy: greedy, by the network's values.
        probes: (k, 4) float32, of the random picks in the last two thirds of the training:
            the item's x, y, z as the network saw them, and 1 if it was unloaded, else 0.
    """

    policy: Policy
    probes: np.ndarray


def learn(
    features: str,
    epsilon: float,
    seed: int,
    picks: int,
    batch_size: int = 256,
    mask: bool = False,
    remember: str = "all",
    network: torch.nn.Module | None = None,
    teacher: Policy | None = None,
) -> Learned:
    """Train as the paper does, but with a constant share of random picks.

    Args:
        features: a name in ``random_picks.TRANSFORMS``.
        epsilon: the share of random picks.
        seed: of the loads, the picks, the batches and the weights.
        picks: over all 64 containers, a multiple of 64; one update per 64 of them.
        batch_size: b.
        mask: whether items that failed since the last success are masked.
        remember: ``"all"`` picks, or the ``"random"`` ones only.
        network: what to train, and what is changed; the paper's with random weights if None.
        teacher: makes the picks that are not random; the network itself if None.

    Raises:
        TypeError, ValueError: an argument is not as described.
    """
    checks.one_of("features", features, TRANSFORMS)
    checks.real("epsilon", epsilon, 0, 1)
    checks.integer("picks", picks, task.NUM_ENVS)
    checks.integer("batch_size", batch_size, 1)
    checks.boolean("mask", mask)
    checks.one_of("remember", remember, REMEMBER)
    transform, rows = TRANSFORMS[features], np.arange(task.NUM_ENVS)
    rng = np.random.default_rng(checks.integer("seed", seed, 0))
    if network is None:
        network = PEQNetwork(generator=torch.Generator().manual_seed(seed))
    agent = DQN(network)
    envs = gymnasium.make_vec("unload/Container-v0", task.NUM_ENVS)
    observed, infos = envs.reset(seed=int(rng.integers(2**31)))
    replay, probes = ReplayBuffer(picks, task.N_VISIBLE), []
    for _ in range(picks // task.NUM_ENVS):
        seen, allowed = transform(observed), infos["action_mask" if mask else "item_mask"]
        explores = rng.random(task.NUM_ENVS) < epsilon
        if teacher is None:
            chosen = greedy_actions(network, seen, allowed)
        else:
            chosen = teacher(observed, allowed, rng)
        actions = np.where(explores, random(observed, allowed, rng), chosen)
        observed, rewards, _, _, infos = envs.step(actions)
        kept = explores if remember == "random" else slice(None)
        replay.add(observations=seen[kept], actions=actions[kept], rewards=rewards[kept])
        agent.update(replay.sample(batch_size, rng))
        probes.append(np.column_stack([seen[rows, actions], rewards > 0])[explores])
    envs.close()
    return Learned(greedy(network, features), np.concatenate(probes[len(probes) // 3 :]))


def trial(
    question: Mapping, seed: int, picks: int = SIZE["picks"], loads: int = SIZE["loads"]
) -> dict:
    """Train with a constant share of random picks, and let the policy unload fresh containers.

    Args:
        question: ``features``, ``epsilon``, ``mask`` and ``remember`` of ``learn``.
        seed: see ``learn``.
        picks: see ``learn``.
        loads: fresh containers.

    Returns:
        The question and the seed; ``msr_mask`` and ``msr_no_mask``, the MSR with and without
        the mask; with noisy ranks ``tried`` and ``succeeded``, the numbers of such probes at
        each rank of the height, from the highest of 128 down.

    Raises:
        TypeError, ValueError: an argument is not as described.
    """
    policy, probes = learn(**question, seed=seed, picks=picks)
    row = {**question, "seed": seed}
    for name, mask in (("mask", True), ("no_mask", False)):
        table = evaluate(policy, loads, LOADS_SEED, mask=mask)
        row[f"msr_{name}"] = table["success_rate"].mean()
    if question["features"] == NOISY:
        places = rank_from_top(probes[:, 2]).astype(int) - 1
        tried = np.bincount(places, minlength=task.N_VISIBLE)
        succeeded = np.bincount(places[probes[:, 3] == 1], minlength=task.N_VISIBLE)
        row |= {"tried": tried.tolist(), "succeeded": succeeded.tolist()}
    return row


def rank_from_top(z: np.ndarray) -> np.ndarray:
    """Return the rank, 1 for the highest of 128 items, of an equalized height in [-1, 1]."""
    return task.N_VISIBLE - np.round((task.N_VISIBLE - 1) * (z + 1) / 2)


def random_share_data(
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = -1,
    seeds: int = SEED_COUNT,
    progress: bool = True,
    **size: int,
) -> None:
    """Answer each of ``QUESTIONS`` with several seeds.

    ``study/random_share.csv`` has a row for each training, ``study/random_share_heights.csv``
    the probes with noisy ranks, nothing masked and all picks remembered: for each rank of the
    height how many were ``tried`` and how many of them ``succeeded``.

    Args:
        folder: of the data.
        runs_dir: where finished trainings are kept.
        n_jobs: processes, as in joblib.
        seeds: how many.
        progress: show a progress bar.
        **size: ``picks`` and ``loads`` of ``trial``, if not its own.
    """
    size = SIZE | size
    fingerprint = training_fingerprint()
    settings = {"loads_seed": LOADS_SEED, **size}
    kept = settings | {"fingerprint": fingerprint}
    jobs = [
        (question | {"seed": seed} | kept, partial(trial, question, seed, **size))
        for question, seed in product(QUESTIONS, range(checks.integer("seeds", seeds, 1)))
    ]
    answers = keep_all(Path(runs_dir) / NAME, jobs, n_jobs, progress)
    rows = [answer.value for answer in answers]
    heights = [
        pd.DataFrame({name: row[name] for name in ("tried", "succeeded")}).assign(
            epsilon=row["epsilon"], seed=row["seed"], rank=range(1, task.N_VISIBLE + 1)
        )
        for row in rows
        if all(row[name] == HALF[name] for name in ("features", "mask", "remember"))
    ]
    publish(
        Path(folder) / "study",
        NAME,
        {NAME: pd.DataFrame(rows)[COLUMNS], f"{NAME}_heights": pd.concat(heights)[HEIGHTS]},
        f"{COMMAND} random-share",
        {"seeds": seeds} | settings,
        seeds < SEED_COUNT or any(size[name] < full for name, full in SIZE.items()),
        [answer.record for answer in answers],
        fingerprint,
    )


def read_random_share(folder: str | Path = files.DATA) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The trainings and their probes by height, see ``random_share_data``.

    Raises:
        FileNotFoundError: they have not been made.
        ValueError: a table has other columns.
    """
    command = f"{COMMAND} random-share"
    trials, heights = (
        read_table(Path(folder) / "study" / f"{name}.csv", command, columns)
        for name, columns in ((NAME, COLUMNS), (f"{NAME}_heights", HEIGHTS))
    )
    return trials, heights
