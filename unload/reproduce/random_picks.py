"""What can be learned from random picks alone, by what the network sees of the positions.

    python -m unload.reproduce offline

In training the agent's own picks decide what it learns from. Here they cannot: each network
is fitted to the same random picks, and differs from the others in its features only.
"""

from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path

import gymnasium
import numpy as np
import pandas as pd
import torch

from unload import task
from unload.agent.dqn import DQN
from unload.agent.evaluation import Policy, evaluate
from unload.agent.greedy import greedy_actions
from unload.env.equalization import equalize
from unload.network.peq import PEQNetwork
from unload.reproduce.fingerprint import training_fingerprint
from unload.reproduce.results import COMMAND, JOBS, keep_all, publish
from unload.support import checks, files

SIZE = {
    "steps": 1500,  # of 64 environments: 96,000 picks
    "updates": 8000,
    "loads": 64,  # fresh containers
}
SEED_COUNT = 5
BATCH_SIZE = 256
LOADS_SEED = 1000
LAST = 500  # updates at the end, whose mean loss is reported
OPTIONS = JOBS

Transform = Callable[[np.ndarray], np.ndarray]


def _ranks_of(axes: list[int], ties: str = "noise") -> Transform:
    """Equalize some axes and leave the others as they are."""

    def transform(observations: np.ndarray) -> np.ndarray:
        changed = np.array(observations, np.float32)
        changed[..., axes] = equalize(observations, ties)[..., axes]
        return changed

    return transform


def _stretched(observations: np.ndarray) -> np.ndarray:
    """Let the visible items just fill [-1, 1]: a scale that depends on the state, and no more."""
    low, high = observations.min(axis=-2, keepdims=True), observations.max(axis=-2, keepdims=True)
    return (2 * (observations - low) / (high - low) - 1).astype(np.float32)


def _centred(observations: np.ndarray) -> np.ndarray:
    """Take away the mean of the visible items: no absolute height."""
    return (observations - observations.mean(axis=-2, keepdims=True)).astype(np.float32)


TRANSFORMS: dict[str, Transform] = {  # of the observation, by the name of the features
    "positions": _ranks_of([]),
    "centred positions": _centred,
    "stretched positions": _stretched,
    "tied ranks": _ranks_of([0, 1, 2], "average"),
    "noisy ranks": _ranks_of([0, 1, 2]),
    "noisy ranks of x": _ranks_of([0]),
    "noisy ranks of y": _ranks_of([1]),
    "noisy ranks of z": _ranks_of([2]),
    "noisy ranks of x and y": _ranks_of([0, 1]),
}


def offline_data(
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = -1,
    seeds: int = SEED_COUNT,
    progress: bool = True,
    **size: int,
) -> None:
    """Fit a network to each of ``TRANSFORMS`` with several seeds: ``study/offline.csv``.

    Args:
        folder: of the data.
        runs_dir: where finished fits are kept.
        n_jobs: processes, as in joblib.
        seeds: how many.
        progress: show a progress bar.
        **size: ``steps``, ``updates`` and ``loads`` of ``fit``, if not its own.
    """
    size = SIZE | size
    settings = {"batch_size": BATCH_SIZE, "loads_seed": LOADS_SEED, **size}
    fingerprint = training_fingerprint()
    question = settings | {"fingerprint": fingerprint}
    jobs = [
        ({"features": name, "seed": seed} | question, partial(fit, name, seed, **size))
        for name, seed in product(TRANSFORMS, range(checks.integer("seeds", seeds, 1)))
    ]
    answers = keep_all(Path(runs_dir) / "offline", jobs, n_jobs, progress)
    publish(
        Path(folder) / "study",
        "offline",
        {"offline": pd.DataFrame([answer.value for answer in answers])},
        f"{COMMAND} offline",
        {"seeds": seeds} | settings,
        seeds < SEED_COUNT or any(size[name] < full for name, full in SIZE.items()),
        [answer.record for answer in answers],
        fingerprint,
    )


def fit(
    features: str,
    seed: int,
    steps: int = SIZE["steps"],
    updates: int = SIZE["updates"],
    loads: int = SIZE["loads"],
) -> dict:
    """Fit the paper's network to random picks, and let it unload fresh containers.

    Args:
        features: a name in ``TRANSFORMS``.
        seed: of the picks, the weights and the batches.
        steps: see ``random_picks``.
        updates: of 256 picks each, with the paper's learning rate.
        loads: fresh containers.

    Returns:
        ``features``, ``seed``; ``loss``, the mean of the last 500 updates; ``msr_mask`` and
        ``msr_no_mask``, with and without the mask; ``deadlocked``, the share of picks in
        deadlocks without it.

    Raises:
        TypeError, ValueError: an argument is not as described.
    """
    checks.one_of("features", features, TRANSFORMS)
    checks.integer("updates", updates, 1)
    picks = random_picks(steps, seed)
    picks["observations"] = TRANSFORMS[features](picks["observations"])
    rng = np.random.default_rng(seed)
    agent = DQN(PEQNetwork(generator=torch.Generator().manual_seed(seed)))
    losses = [
        agent.update(picks, rng.integers(len(picks["actions"]), size=BATCH_SIZE))
        for _ in range(updates)
    ]
    policy = greedy(agent.network, features)
    masked, unmasked = (evaluate(policy, loads, LOADS_SEED, mask=mask) for mask in (True, False))
    return {
        "features": features,
        "seed": seed,
        "loss": float(np.mean(losses[-LAST:])),
        "msr_mask": masked["success_rate"].mean(),
        "msr_no_mask": unmasked["success_rate"].mean(),
        "deadlocked": unmasked["deadlocked"].mean(),
    }


def random_picks(steps: int, seed: int) -> dict[str, np.ndarray]:
    """Random picks in 64 containers, without the mask.

    Args:
        steps: of all environments.
        seed: of the loads and the picks.

    Returns:
        ``observations`` (64 steps, 128, 3) float32, ``actions`` (64 steps,) int64,
        ``rewards`` (64 steps,) float32.
    """
    checks.integer("steps", steps, 1)
    rng = np.random.default_rng(checks.integer("seed", seed, 0))
    envs = gymnasium.make_vec("unload/Container-v0", task.NUM_ENVS)
    seen, actions, rewards = [], [], []
    observations, _ = envs.reset(seed=int(rng.integers(2**31)))
    for _ in range(steps):
        seen.append(observations)
        actions.append(rng.integers(task.N_VISIBLE, size=task.NUM_ENVS))
        observations, reward, _, _, _ = envs.step(actions[-1])
        rewards.append(reward)
    envs.close()
    return {
        "observations": np.concatenate(seen),
        "actions": np.concatenate(actions),
        "rewards": np.concatenate(rewards).astype(np.float32),
    }


def greedy(network: torch.nn.Module, features: str) -> Policy:
    """The greedy policy of a network; ``features``, a name in ``TRANSFORMS``, is what it sees."""

    def policy(observations, masks, rng):
        return greedy_actions(network, TRANSFORMS[features](observations), masks)

    return policy
