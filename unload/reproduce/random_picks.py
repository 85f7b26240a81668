"""What can be learned from random picks alone, by what the network sees of the positions.

In training the agent's own picks decide what it learns from. Here they cannot: each network
is fitted to the same random picks, and differs from the others in its features only.
"""

import time
from collections.abc import Callable
from itertools import product
from pathlib import Path

import gymnasium
import numpy as np
import pandas as pd
import torch
from joblib import Parallel, delayed

from unload import task
from unload.agent.dqn import DQN
from unload.agent.evaluation import evaluate
from unload.agent.greedy import greedy_actions
from unload.env.equalization import equalize
from unload.network.peq import PEQNetwork
from unload.support import checks, files
from unload.support.provenance import joined, run_record, write_provenance

STEPS = 1500  # of 64 environments: 96,000 picks
UPDATES = 8000
BATCH_SIZE = 256
SEEDS = 5
LOADS, LOADS_SEED = 64, 1000
LAST = 500  # updates whose loss is told

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


FEATURES: dict[str, Transform] = {
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


def random_picks(steps: int, seed: int) -> dict[str, np.ndarray]:
    """Random picks in 64 containers, not told what failed.

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


def fit(
    features: str, seed: int, steps: int = STEPS, updates: int = UPDATES, loads: int = LOADS
) -> dict:
    """Fit the paper's network to random picks, and let it unload fresh containers.

    Args:
        features: a name in ``FEATURES``.
        seed: of the picks, the weights and the batches.
        steps: see ``random_picks``.
        updates: of 256 picks each, with the paper's learning rate.
        loads: fresh containers.

    Returns:
        ``features``, ``seed``; ``loss``, the mean of the last 500 updates; ``msr_mask`` and
        ``msr_no_mask``, told which items failed or not; ``deadlocked``, the share of picks in
        deadlocks if not.

    Raises:
        TypeError, ValueError: an argument is not as described.
    """
    checks.one_of("features", features, FEATURES)
    checks.integer("updates", updates, 1)
    transform, picks = FEATURES[features], random_picks(steps, seed)
    picks["observations"] = transform(picks["observations"])
    rng = np.random.default_rng(seed)
    agent = DQN(PEQNetwork(generator=torch.Generator().manual_seed(seed)))
    losses = [
        agent.update(picks, rng.integers(len(picks["actions"]), size=BATCH_SIZE))
        for _ in range(updates)
    ]

    def policy(observations, masks, rng):
        return greedy_actions(agent.network, transform(observations), masks)

    told, not_told = (evaluate(policy, loads, LOADS_SEED, mask=mask) for mask in (True, False))
    return {
        "features": features,
        "seed": seed,
        "loss": float(np.mean(losses[-LAST:])),
        "msr_mask": told["success_rate"].mean(),
        "msr_no_mask": not_told["success_rate"].mean(),
        "deadlocked": not_told["deadlocked"].mean(),
    }


def offline_data(
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = -1,
    seeds: int = SEEDS,
    **size: int,
) -> None:
    """Fit all ``FEATURES`` with several seeds: ``study/offline.csv``, one row per fit.

    Args:
        folder: of the data.
        runs_dir: where finished fits are kept.
        n_jobs: processes, as in joblib.
        seeds: how many.
        **size: ``steps``, ``updates`` and ``loads`` of ``fit``, if not its own.
    """
    full = {"steps": STEPS, "updates": UPDATES, "loads": LOADS}
    size = full | size
    kept = Path(runs_dir) / "offline" / "_".join(f"{value}_{name}" for name, value in size.items())
    jobs = [
        delayed(_kept)(features, seed, kept, size)
        for features, seed in product(FEATURES, range(checks.integer("seeds", seeds, 1)))
    ]
    results = Parallel(n_jobs)(jobs)
    table = pd.DataFrame([result["row"] for result in results])
    folder = Path(folder) / "study"
    files.write_text(folder / "offline.csv", table.to_csv(index=False, float_format="%.6g"))
    settings = {"seeds": seeds, "batch_size": BATCH_SIZE, "loads_seed": LOADS_SEED, **size}
    reduced = seeds < SEEDS or any(size[name] < full[name] for name in full)
    record = joined(result["record"] for result in results)
    write_provenance(
        folder, "offline", "python -m unload.reproduce offline", settings, reduced, record
    )


def _kept(features: str, seed: int, folder: Path, size: dict[str, int]) -> dict:
    """The row and record of a fit, from its file if it has been made before."""
    path = folder / f"{features}_{seed}.json"
    if not path.exists():
        threads = torch.get_num_threads()
        torch.set_num_threads(1)  # the fits share the cores among themselves
        start = time.monotonic()
        try:
            row = fit(features, seed, **size)
        finally:
            torch.set_num_threads(threads)
        files.write_json(path, {"row": row, "record": run_record(time.monotonic() - start)})
    return files.read_json(path)
