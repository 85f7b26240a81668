"""The paper's training in the container (Sec. IV-B), for Figs. 11 and 12.

Made by ``python -m unload.reproduce training``.
"""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from unload import task
from unload.agent.config import TrainConfig
from unload.agent.evaluation import evaluate
from unload.agent.sweep import run_all
from unload.agent.training import TrainResult, train
from unload.agent.weights import save_policy
from unload.reproduce.fingerprint import training_fingerprint
from unload.reproduce.results import COMMAND, JOBS, publish, shared_settings, write_table
from unload.support import checks, files

PAPER_PICKS = TrainConfig().picks
SEEDS = (0, 1, 2, 3)
LOG_INTERVAL = 100  # steps of all environments per point of the training's loss
EVALUATION = {"episodes": 50, "seed": 1000}  # fresh containers for the trained policies

OPTIONS = {
    "--picks": {"type": int, "default": PAPER_PICKS},
    "--seeds": {"type": int, "nargs": "+", "default": SEEDS},
    **JOBS,
}


def training_data(
    picks: int = PAPER_PICKS,
    seeds: Sequence[int] = SEEDS,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = -1,
    progress: bool = True,
) -> None:
    """Train the paper's configuration with several seeds; write curves, policies and a summary.

    Writes ``loss_function_agent.csv`` and ``total_rew_function_agent.csv`` with the columns
    ``Wall time,Step,Value`` of a TensorBoard export, the reward summed over an episode of
    500 picks; the same of the seeds after the first one, with ``_seed_<seed>`` after the
    name; the trained policies, ``policies/paper.safetensors`` and ``policies/paper_seed_<seed>``;
    ``training_curves.csv``, means over each episode of all environments; and
    ``training_summary.csv``, see ``training_summary``.

    Args:
        picks: K, at least one episode of all environments.
        seeds: of the runs; the first one is the paper's line in the figures.
        folder: of the data.
        runs_dir: where the runs are kept, apart from those of code that trained otherwise.
        n_jobs: processes, see ``run_sweep``.
        progress: show a progress bar.

    Raises:
        TypeError, ValueError: ``picks`` is not as described.
        RuntimeError: a run failed; the message says which and why.
    """
    checks.integer("picks", picks, task.NUM_ENVS * task.MAX_PICKS)
    fingerprint = training_fingerprint()
    folder, kept = Path(folder), Path(runs_dir) / f"training/{fingerprint}/{picks}_picks"
    configs = {
        f"seed_{seed}": TrainConfig(picks=picks, seed=seed, log_interval=LOG_INTERVAL)
        for seed in seeds
    }
    records = run_all(configs, kept, n_jobs, progress)
    results = [train(config, kept / name) for name, config in configs.items()]
    for old in (*folder.glob("*_agent_seed_*.csv"), *folder.glob("policies/paper_seed_*")):
        old.unlink()  # it may be of a seed that is not among these
    for number, (seed, result) in enumerate(zip(seeds, results)):
        suffix = f"_seed_{seed}" if number else ""
        _write_export(folder / f"loss_function_agent{suffix}.csv", result.curve, "loss")
        episodes = _episodes(result.curve)
        episodes["reward"] = episodes["mean_reward"] * task.MAX_PICKS
        _write_export(folder / f"total_rew_function_agent{suffix}.csv", episodes, "reward")
        save_policy(result.policy, folder / "policies" / f"paper{suffix}.safetensors")
    columns = ["seed", "picks", "success_rate", "deadlocked", "loss", "epsilon"]
    curves = [_episodes(result.curve).assign(seed=seed) for seed, result in zip(seeds, results)]
    rows = [
        {"seed": seed, **training_summary(result), **_cost(record)}
        for seed, result, record in zip(seeds, results, records)
    ]
    tables = {"training_curves": pd.concat(curves)[columns], "training_summary": pd.DataFrame(rows)}
    settings = {
        "picks": picks,
        "seeds": list(seeds),
        "evaluation": EVALUATION,
        "config": shared_settings(configs),
    }
    command = f"{COMMAND} training --picks {picks} --seeds {' '.join(map(str, seeds))}"
    reduced = picks < PAPER_PICKS
    publish(folder, "training", tables, command, settings, reduced, records, fingerprint)


def training_summary(result: TrainResult) -> dict[str, float]:
    """How a training run began and ended, and how its policy does on fresh containers.

    Returns:
        ``msr_start``, ``msr_end`` and ``msr_best``: the MSR while training over the first
        episode of all environments, the last hundredth of the picks (at least one episode),
        and the best episode. ``msr_mask``, ``msr_no_mask``: the MSR of the trained policy on
        50 fresh containers with and without the mask, each with its standard deviation over
        the containers, and the share of picks in deadlocks without the mask.
    """
    msr = _episodes(result.curve)["success_rate"]
    row = {
        "msr_start": msr.iloc[0],
        "msr_end": msr.iloc[-max(1, len(msr) // 100) :].mean(),
        "msr_best": msr.max(),
    }
    for name, mask in (("mask", True), ("no_mask", False)):
        table = evaluate(result.policy, **EVALUATION, mask=mask)
        row[f"msr_{name}"] = table["success_rate"].mean()
        row[f"msr_{name}_std"] = table["success_rate"].std()
    return row | {"deadlocked_no_mask": table["deadlocked"].mean()}


def _episodes(curve: pd.DataFrame) -> pd.DataFrame:
    """Means of a curve over each episode; all environments start theirs together."""
    points = task.MAX_PICKS // LOG_INTERVAL
    complete = curve[: len(curve) // points * points]
    groups = complete.groupby(complete.index // points)
    return groups.mean().assign(**groups[["picks", "wall_time", "epsilon"]].last())


def _write_export(path: Path, curve: pd.DataFrame, value: str) -> None:
    """A column of a curve as TensorBoard exports it."""
    names = {"wall_time": "Wall time", "picks": "Step", value: "Value"}
    write_table(path, curve[list(names)].rename(columns=names).dropna(), "%.12g")


def _cost(record: dict) -> dict:
    """Wall time and peak memory of a run."""
    return {name: record[name] for name in ("wall_time_s", "peak_memory_mib")}
