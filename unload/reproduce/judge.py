"""What the runs of ``unload.study`` have learned, and when."""

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pandas as pd
from joblib import Parallel, delayed

from unload.agent.config import TrainConfig
from unload.agent.evaluation import evaluate
from unload.agent.greedy import Greedy
from unload.agent.sweep import run_all
from unload.agent.weights import load_policy, save_policy
from unload.reproduce.results import read_table
from unload.reproduce.study import EXPERIMENTS, features_of
from unload.support import checks, files
from unload.support.provenance import joined, write_provenance

COMMAND = "python -m unload.reproduce study"
LOADS = 200  # fresh containers that judge a trained policy
SNAPSHOT_LOADS = 32  # that judge what it had learned on the way
LOADS_SEED = 1000
GOAL = 0.99  # MSR


def study_data(
    experiment: str,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = -1,
    progress: bool = True,
    **size: int,
) -> None:
    """Make an experiment: ``study/<experiment>.csv`` and ``study/<experiment>_curves.csv``.

    They hold the rows and curves of ``judge``, with each run's name in ``run``. The
    recommended agent's first run also leaves ``policies/recommended.safetensors``.

    Args:
        experiment: a name in ``unload.study.EXPERIMENTS``.
        folder: of the data.
        runs_dir: where the runs are kept.
        n_jobs: processes, see ``run_sweep``.
        progress: show a progress bar.
        **size: ``picks`` and ``seeds`` of the experiment, if not its own.

    Raises:
        ValueError: an unknown experiment.
        RuntimeError: a run failed; the message says which and why.
    """
    checks.one_of("experiment", experiment, EXPERIMENTS)
    configs = EXPERIMENTS[experiment](**size)
    kept, folder = Path(runs_dir) / "study" / experiment, Path(folder)
    records = run_all(configs, kept, n_jobs, progress)
    judged = Parallel(n_jobs)(
        delayed(judge)(config, kept / name) for name, config in configs.items()
    )
    rows = [{"run": name, **row} for name, (row, _) in zip(configs, judged)]
    curves = [curve.assign(run=name) for name, (_, curve) in zip(configs, judged)]
    for name, table in (("", pd.DataFrame(rows)), ("_curves", pd.concat(curves))):
        text = table.to_csv(index=False, float_format="%.6g")
        files.write_text(folder / "study" / f"{experiment}{name}.csv", text)
    if experiment == "recommended":
        best = load_policy(kept / next(iter(configs)) / "policy.safetensors")
        save_policy(best, folder / "policies" / "recommended.safetensors")
    settings = {"loads": LOADS, "loads_seed": LOADS_SEED, "snapshot_loads": SNAPSHOT_LOADS}
    write_provenance(
        folder / "study",
        experiment,
        f"{COMMAND} --experiments {experiment}",
        settings | size,
        bool(size),
        joined(records),
    )


def judge(config: TrainConfig, folder: str | Path) -> tuple[dict, pd.DataFrame]:
    """What a finished run in ``folder`` has learned, and when.

    Returns:
        A row: ``features``, the configuration's fields, and ``msr_mask`` and ``msr_no_mask``,
        the MSR of the trained policy on 200 fresh loads, told which items failed since the
        last success or not; ``deadlocked`` and ``longest_deadlock``, the share of picks in
        deadlocks and the longest one in any load, without the mask; ``msr_training`` and
        ``deadlocked_training`` over the last tenth of the training, ``deadlocked_overall``
        over all of it; ``picks_to_goal_mask`` and ``picks_to_goal_no_mask``, the first
        snapshot with an MSR of 99 % and more on 32 loads, NaN if there is none.

        The curve, one row per snapshot: ``picks``; ``success_rate``, ``deadlocked`` and
        ``loss`` of the training since the last one, means over the points of the run's curve
        that lie between, NaN if none does; ``msr_mask`` and ``msr_no_mask``.
    """
    folder = Path(folder)
    training = pd.read_csv(folder / "curve.csv")
    curve = _curve(training, sorted((folder / "snapshots").glob("*.safetensors")))
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


def read_study(
    experiment: str, folder: str | Path = files.DATA
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """An experiment's rows and curves; the curves have the rows' settings beside them.

    Raises:
        ValueError: an unknown experiment.
        FileNotFoundError: the experiment has not been made.
    """
    checks.one_of("experiment", experiment, EXPERIMENTS)
    command = f"{COMMAND} --experiments {experiment}"
    rows, curves = (
        read_table(Path(folder) / "study" / f"{experiment}{name}.csv", command, ["run"])
        for name in ("", "_curves")
    )
    settings = ["run", "features", *(name for name in asdict(TrainConfig()) if name in rows)]
    settings.remove("picks")  # of the whole run; the curve's are those so far
    return rows, curves.merge(rows[settings], on="run")


def _curve(training: pd.DataFrame, snapshots: list[Path]) -> pd.DataFrame:
    """A row per snapshot, see ``judge``."""
    points, start = [], 0
    for path in snapshots:
        picks, policy = int(path.stem), load_policy(path)
        since = training[(training["picks"] > start) & (training["picks"] <= picks)]
        point = {"picks": picks, **since[["success_rate", "deadlocked", "loss"]].mean()}
        for name, mask in (("mask", True), ("no_mask", False)):
            point[f"msr_{name}"] = _play(policy, SNAPSHOT_LOADS, mask)["success_rate"].mean()
        points.append(point)
        start = picks
    return pd.DataFrame(points)


def _play(policy: Greedy, loads: int, mask: bool) -> pd.DataFrame:
    """Fresh containers; the environment equalizes, faster than the policy would."""
    ready = Greedy(policy.network, equalize=False)
    seen = {"equalize": policy.equalize, "ties": policy.ties}
    return evaluate(ready, loads, LOADS_SEED, mask=mask, **seen)
