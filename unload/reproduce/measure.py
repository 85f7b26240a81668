"""Evaluation of a finished run and of its snapshots."""

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pandas as pd

from unload.agent.checkpoint import RunFolder
from unload.agent.config import TrainConfig
from unload.agent.evaluation import evaluate
from unload.agent.greedy import Greedy
from unload.agent.weights import load_policy

POLICY_LOADS = 200  # fresh containers for a trained policy
SNAPSHOT_LOADS = 32  # fresh containers for a snapshot
LOADS_SEED = 1000
GOAL = 0.99  # MSR


def measure_run(config: TrainConfig, folder: str | Path) -> tuple[dict, pd.DataFrame]:
    """Measure a finished run in ``folder``.

    Returns:
        A row: the configuration's fields, and ``msr_mask`` and ``msr_no_mask``, the MSR of
        the trained policy on 200 fresh loads with and without the mask; ``deadlocked`` and
        ``longest_deadlock``, the share of picks in deadlocks and the longest one in any load,
        without the mask; ``msr_training`` and ``deadlocked_training`` over the last tenth of
        the training, ``deadlocked_overall`` over all of it; ``picks_to_goal_mask`` and
        ``picks_to_goal_no_mask``, the first snapshot with an MSR of 99 % and more on 32
        loads, NaN if there is none.

        The curve, one row per snapshot: ``picks``; ``success_rate``, ``deadlocked`` and
        ``loss`` of the training since the last one, means over the points of the run's curve
        that lie between, NaN if none does; ``msr_mask`` and ``msr_no_mask``.

    Raises:
        FileNotFoundError: the run has not finished.
        ValueError: a file of the run is damaged, or the run is of another configuration.
    """
    policy, training = RunFolder(folder).result(config)
    curve = _curve(training, sorted((Path(folder) / "snapshots").glob("*.safetensors")))
    masked, unmasked = (on_fresh_loads(policy, POLICY_LOADS, mask) for mask in (True, False))
    end = training[training["picks"] > 0.9 * config.picks]
    row = {
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


def _curve(training: pd.DataFrame, snapshots: list[Path]) -> pd.DataFrame:
    """A row per snapshot, see ``measure_run``."""
    points, start = [], 0
    for path in snapshots:
        picks, policy = int(path.stem), load_policy(path)
        since = training[(training["picks"] > start) & (training["picks"] <= picks)]
        point = {"picks": picks, **since[["success_rate", "deadlocked", "loss"]].mean()}
        for name, mask in (("mask", True), ("no_mask", False)):
            point[f"msr_{name}"] = on_fresh_loads(policy, SNAPSHOT_LOADS, mask)[
                "success_rate"
            ].mean()
        points.append(point)
        start = picks
    return pd.DataFrame(points)


def on_fresh_loads(policy: Greedy, loads: int, mask: bool) -> pd.DataFrame:
    """Evaluate a policy, see ``unload.evaluate``; the environment equalizes, which is faster."""
    ready = Greedy(policy.network, equalize=False)
    seen = {"equalize": policy.equalize, "ties": policy.ties}
    return evaluate(ready, loads, LOADS_SEED, mask=mask, **seen)
