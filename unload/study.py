"""Why 60 %? Controlled experiments on the paper's training.

Each experiment is a set of training runs that differ from the paper's configuration in what
is under test and in the seed only, but for the batch of 256 picks: it makes an update eight
times cheaper, and the search shows what it changes.
"""

from collections.abc import Callable
from dataclasses import asdict, replace
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd

from unload import files
from unload.agent import Greedy, load_policy
from unload.config import TrainConfig
from unload.evaluate import evaluate

# What the network sees of an item's position.
FEATURES = {
    "positions": {"equalize": False},  # scaled
    "noisy ranks": {"equalize": True, "ties": "noise"},  # equalized, as in the paper
    "tied ranks": {"equalize": True, "ties": "average"},
}
FLOORS = (0.0, 0.05)  # of the exploration rate
BASE = TrainConfig(batch_size=256, snapshots=20)
LOADS = 200  # fresh containers that judge a trained policy
SNAPSHOT_LOADS = 64  # that judge what it had learned on the way
LOADS_SEED = 1000
GOAL = 0.99  # MSR


def factorial(picks: int = 2_000_000, seeds: int = 5) -> dict[str, TrainConfig]:
    """Features × mask in training × exploration floor."""
    return {
        f"{features}/{'mask' if mask else 'no mask'}/floor {floor:g}/seed_{seed}": replace(
            BASE, picks=picks, seed=seed, mask=mask, epsilon_final=floor, **FEATURES[features]
        )
        for features, mask, floor, seed in product(FEATURES, (False, True), FLOORS, range(seeds))
    }


def search(picks: int = 1_000_000, seeds: int = 3) -> dict[str, TrainConfig]:
    """One setting at a time, with the paper's features and with positions."""
    changes = [
        {},
        {"n_features": 16},
        {"n_features": 256},
        {"learning_rate": 1e-4},
        {"learning_rate": 1e-2},
        {"batch_size": 64},
        {"batch_size": 2048},
        {"gradient_steps": 4},
    ]
    return _varied(changes, ("noisy ranks", "positions"), picks, seeds)


def rewards(picks: int = 1_000_000, seeds: int = 3) -> dict[str, TrainConfig]:
    """The paper's outlook: failing at a higher item is less bad."""
    changes = [{"height_reward": share} for share in (0.0, 0.25, 0.5, 0.9)]
    return _varied(changes, ("noisy ranks", "tied ranks", "positions"), picks, seeds)


def networks(picks: int = 640_000, seeds: int = 3) -> dict[str, TrainConfig]:
    """Other networks; small ones and small batches, to be affordable without a fused update."""
    small = {"n_features": 32, "batch_size": 64}
    changes = [{"network": name} | small for name in ("peq", "two_layer", "stack", "attention")]
    return _varied(changes, ("noisy ranks",), picks, seeds)


def long(picks: int = 20_000_000, seeds: int = 3) -> dict[str, TrainConfig]:
    """The best cell of the factorial study for as long as the paper trained."""
    return _varied([{}], ("positions",), picks, seeds)


def recommended(picks: int = 1_000_000, seeds: int = 5) -> dict[str, TrainConfig]:
    """The paper's configuration in all but one thing: the network sees positions, not ranks."""
    return _varied([{"batch_size": TrainConfig().batch_size}], ("positions",), picks, seeds)


EXPERIMENTS: dict[str, Callable[..., dict[str, TrainConfig]]] = {
    experiment.__name__: experiment
    for experiment in (factorial, recommended, networks, search, rewards, long)
}


def _varied(
    changes: list[dict], features: tuple[str, ...], picks: int, seeds: int
) -> dict[str, TrainConfig]:
    """A run for each change, features and seed."""
    return {
        f"{name}/{_name(change)}/seed_{seed}": replace(
            BASE, picks=picks, seed=seed, **FEATURES[name], **change
        )
        for name, change, seed in product(features, changes, range(seeds))
    }


def _name(change: dict) -> str:
    return ", ".join(f"{field} {value}" for field, value in change.items()) or "base"


def features_of(config: TrainConfig) -> str:
    """The name in ``FEATURES`` of what a configuration lets the network see."""
    if not config.equalize:
        return "positions"
    return {"noise": "noisy ranks", "average": "tied ranks"}[config.ties]


def judge(config: TrainConfig, folder: str | Path) -> tuple[dict, pd.DataFrame]:
    """What a finished run in ``folder`` has learned, and when.

    Returns:
        A row: ``features``, the configuration's fields, and ``msr_mask`` and ``msr_no_mask``,
        the MSR of the trained policy on 200 fresh loads, told which items failed since the
        last success or not; ``deadlocked`` and ``longest_deadlock``, the share of picks in
        deadlocks and the longest one in any load, without the mask; ``msr_training`` and
        ``deadlocked_training`` over the last tenth of the training, ``deadlocked_overall`` over
        all of it; ``picks_to_goal_mask`` and ``picks_to_goal_no_mask``, the first snapshot with an
        MSR of 99 % and more on 64 loads, NaN if there is none.

        The curve, one row per snapshot: ``picks``; ``success_rate``, ``deadlocked``, ``loss``
        of the training since the last one; ``msr_mask`` and ``msr_no_mask``.
    """
    folder = Path(folder)
    training = pd.read_csv(folder / "curve.csv")
    snapshots = sorted((folder / "snapshots").glob("*.safetensors"))
    points = []
    start = 0
    for path in snapshots:
        picks, policy = int(path.stem), load_policy(path)
        since = training[(training["picks"] > start) & (training["picks"] <= picks)]
        means = since[["success_rate", "deadlocked", "loss"]].mean()
        played = {
            f"msr_{name}": _play(policy, SNAPSHOT_LOADS, mask)["success_rate"].mean()
            for name, mask in (("mask", True), ("no_mask", False))
        }
        points.append({"picks": picks, **means, **played})
        start = picks
    curve = pd.DataFrame(points)
    policy = load_policy(folder / "policy.safetensors")
    masked, unmasked = (_play(policy, LOADS, mask) for mask in (True, False))
    end = training[training["picks"] > 0.9 * config.picks]
    row = {
        "features": features_of(config),
        **asdict(config),
        "msr_mask": masked["success_rate"].mean(),
        "msr_no_mask": unmasked["success_rate"].mean(),
        "deadlocked": unmasked["deadlocked"].mean(),
        "longest_deadlock": int(unmasked["longest_deadlock"].max()),
        "msr_training": end["success_rate"].mean(),
        "deadlocked_training": end["deadlocked"].mean(),
        "deadlocked_overall": training["deadlocked"].mean(),
    }
    for name in ("mask", "no_mask"):
        reached = curve.loc[curve[f"msr_{name}"] >= GOAL, "picks"]
        row[f"picks_to_goal_{name}"] = reached.iloc[0] if len(reached) else np.nan
    return row, curve


def _play(policy: Greedy, loads: int, mask: bool) -> pd.DataFrame:
    """Fresh containers; the environment equalizes, faster than the policy would."""
    ready = Greedy(policy.network, equalize=False)
    seen = {"equalize": policy.equalize, "ties": policy.ties}
    return evaluate(ready, loads, LOADS_SEED, mask=mask, **seen)


def read(experiment: str, folder: str | Path = files.DATA) -> tuple[pd.DataFrame, pd.DataFrame]:
    """An experiment's rows and curves, as ``judge`` gives them, with each run's name in ``run``.

    Raises:
        FileNotFoundError: the experiment has not been made.
    """
    folder = Path(folder) / "study"
    rows = pd.read_csv(folder / f"{experiment}.csv")
    curves = pd.read_csv(folder / f"{experiment}_curves.csv")
    return rows, curves.merge(rows, on="run", suffixes=("", "_end"))
