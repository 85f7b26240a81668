"""The data behind the paper's figures, computed and kept in ``data/`` with its provenance.

    python -m unload.reproduce lifts          the lift table
    python -m unload.reproduce agreement      the table against the physics it stands for
    python -m unload.reproduce observation    Figs. 4–6
    python -m unload.reproduce tuning         Figs. 8–10
    python -m unload.reproduce training       Figs. 11 and 12
    python -m unload.reproduce study          why 60 %: the controlled experiments
    python -m unload.reproduce offline        what random picks alone teach
    python -m unload.reproduce comparison     policies under other conditions
    python -m unload.reproduce robustness     policies with every box simulated
    python -m unload.reproduce paper          all of them

File names and columns are those that the paper's own plots read. What has been computed is
kept in ``runs/``: a command that was stopped goes on where it was, and what is finished is
not repeated. Each training run writes its progress to ``log.txt`` in its folder there.
"""

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from itertools import product
from pathlib import Path

import gymnasium
import numpy as np
import pandas as pd
from tqdm import tqdm

from unload import task
from unload.agent import policies
from unload.agent.config import TrainConfig
from unload.agent.evaluation import evaluate
from unload.agent.sweep import run_all
from unload.agent.training import TrainResult, train
from unload.agent.weights import save_policy
from unload.env import observation
from unload.env.equalization import equalize
from unload.physics.table import LiftTable
from unload.reproduce import tuning
from unload.reproduce.agreement import agreement_data
from unload.reproduce.comparison import comparison_data
from unload.reproduce.judge import study_data
from unload.reproduce.players import POLICIES
from unload.reproduce.random_picks import offline_data
from unload.reproduce.robustness import robustness_data
from unload.reproduce.study import EXPERIMENTS
from unload.support import checks, files
from unload.support.provenance import joined, run_record, write_provenance

COMMAND = "python -m unload.reproduce"
LIFT_EPISODES = 12
PAPER_PICKS = TrainConfig().picks
SEEDS = (0, 1, 2, 3)
LOG_INTERVAL = 100  # steps of all environments per point of the training's loss
RANDOM_SHARE = 40  # episodes of random picks per episode of each other taste, to fill the table
EVALUATION = {"episodes": 50, "seed": 1000}  # fresh containers for the trained policies


def observation_data(seed: int = 0, folder: str | Path = files.DATA) -> None:
    """Item positions of a fresh container, for Figs. 4–6.

    Writes ``obs_hist_equal/{all_items,Observation,Equalized_Observation}.csv`` with columns
    ``x`` and ``y``: scaled x and z of all items, of the 128 observed ones, and of the
    observed ones after equalization.
    """
    start = time.monotonic()
    folder = Path(folder) / "obs_hist_equal"
    env = gymnasium.make("unload/Container-v0").unwrapped
    observed, _ = env.reset(seed=checks.integer("seed", seed, 0))
    everything = observation.scale(env.observed_positions())
    env.close()
    tables = {
        "all_items": everything,
        "Observation": observed,
        "Equalized_Observation": equalize(observed),
    }
    for name, points in tables.items():
        frame = pd.DataFrame(points[:, [0, 2]], columns=["x", "y"])
        files.write_text(folder / f"{name}.csv", frame.to_csv(index=False, float_format="%.6f"))
    record = run_record(time.monotonic() - start)
    write_provenance(folder, "observation", f"{COMMAND} observation", {"seed": seed}, False, record)


def lift_data(
    episodes: int = LIFT_EPISODES,
    seed: int = 0,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    progress: bool = True,
) -> None:
    """Lifts that a newcomer's containers will meet, ``lifts.npz``.

    Fills an empty table by playing with policies of very different tastes: the highest or the
    nearest item, mixed with random ones to various degrees, or the item that is farthest in
    some direction; and with random picks far longer, since these leave the most situations
    behind.

    Args:
        episodes: of 64 containers for each of the 20 tastes, and ``RANDOM_SHARE`` times as
            many of random picks.
        seed: of the episodes.
        folder: of the table.
        runs_dir: where the table is kept with its record, not to be computed again.
        progress: show a progress bar.
    """
    settings = {
        "episodes of 64 containers per taste": checks.integer("episodes", episodes, 1),
        "of random picks": RANDOM_SHARE * episodes,
        "seed": checks.integer("seed", seed, 0),
    }
    kept = Path(runs_dir) / f"lifts/{episodes}_episodes_seed_{seed}"
    if not (kept / "record.json").exists():
        start = time.monotonic()
        rng = np.random.default_rng(seed)
        envs = gymnasium.make_vec("unload/Container-v0", task.NUM_ENVS).unwrapped
        envs.table = LiftTable()
        jobs = list(product(range(episodes), _tastes(rng)))
        for _, policy in tqdm(
            jobs, unit="episode", disable=not progress, ncols=100, file=sys.stdout
        ):
            observations, infos = envs.reset(seed=int(rng.integers(2**31)))
            for _ in range(task.MAX_PICKS):
                actions = policy(observations, infos["action_mask"], rng)
                observations, _, _, _, infos = envs.step(actions)
        envs.close()
        envs.table.close()
        envs.table.save(kept / "lifts.npz")
        files.write_json(kept / "record.json", run_record(time.monotonic() - start))
    table = LiftTable.load(kept / "lifts.npz")
    table.save(Path(folder) / "lifts.npz")
    record = files.read_json(kept / "record.json")
    settings["lifts"] = len(table)
    reduced = episodes < LIFT_EPISODES
    write_provenance(folder, "lifts", f"{COMMAND} lifts", settings, reduced, record)


def _tastes(rng: np.random.Generator) -> list[Callable]:
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


def tuning_data(
    learning_rates: Sequence[float] = tuning.LEARNING_RATES,
    batch_sizes: Sequence[int] = tuning.BATCH_SIZES,
    runs: int = tuning.RUNS,
    steps: int = tuning.STEPS,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = -1,
    progress: bool = True,
) -> None:
    """Curves in the hyperparameter-tuning environment, for Figs. 8–10.

    Every configuration is run with and without feature engineering. Writes the curves, see
    ``unload.tuning.export_curves``, and ``tuning_summary.csv``, see
    ``unload.tuning.tuning_summary``.

    Args:
        learning_rates: μ.
        batch_sizes: b.
        runs: per configuration.
        steps: K.
        folder: of the data.
        runs_dir: where the runs are kept.
        n_jobs: processes, see ``run_sweep``.
        progress: show a progress bar.

    Raises:
        RuntimeError: a run failed; the message says which and why.
    """
    folder, kept = Path(folder), Path(runs_dir) / f"tuning/{steps}_steps"
    configs = tuning.tuning_grid(learning_rates, batch_sizes, runs, steps=steps)
    records = run_all(configs, kept, n_jobs, progress)
    curves = {name: train(config, kept / name).curve for name, config in configs.items()}
    for old in folder.glob("dummy_sim_*/*_curve_*.csv"):
        old.unlink()  # it may be of a run that is not among these
    for name, curve in curves.items():
        tuning.export_curves(name, curve, folder)
    summary = tuning.tuning_summary(configs, curves)
    _write_table(folder / "tuning_summary.csv", summary)
    settings = {
        "learning_rates": list(learning_rates),
        "batch_sizes": list(batch_sizes),
        "runs": runs,
        "steps": steps,
        "equalize": [True, False],
        "config": _shared(configs),
    }
    paper = {"learning_rates": tuning.LEARNING_RATES, "batch_sizes": tuning.BATCH_SIZES}
    complete = all(set(values) <= set(settings[name]) for name, values in paper.items())
    reduced = steps < tuning.STEPS or runs < tuning.RUNS or not complete
    command = (
        f"{COMMAND} tuning --learning-rates {_listed(learning_rates)} "
        f"--batch-sizes {_listed(batch_sizes)} --runs {runs} --steps {steps}"
    )
    write_provenance(folder, "tuning", command, settings, reduced, joined(records))


def training_data(
    picks: int = PAPER_PICKS,
    seeds: Sequence[int] = SEEDS,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = -1,
    progress: bool = True,
) -> None:
    """The paper's training in the container (Sec. IV-B), for Figs. 11 and 12.

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
        runs_dir: where the runs are kept.
        n_jobs: processes, see ``run_sweep``.
        progress: show a progress bar.

    Raises:
        RuntimeError: a run failed; the message says which and why.
    """
    checks.integer("picks", picks, task.NUM_ENVS * task.MAX_PICKS)
    folder, kept = Path(folder), Path(runs_dir) / f"training/{picks}_picks"
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
        for name, points in (
            ("loss_function_agent", result.curve.rename(columns={"loss": "Value"})),
            ("total_rew_function_agent", _rewards(result.curve)),
        ):
            points = points.rename(columns={"wall_time": "Wall time", "picks": "Step"})
            points = points[["Wall time", "Step", "Value"]].dropna()
            _write_table(folder / f"{name}{suffix}.csv", points, digits=12)
        save_policy(result.policy, folder / "policies" / f"paper{suffix}.safetensors")
    episodes = [_episodes(result.curve).assign(seed=seed) for seed, result in zip(seeds, results)]
    columns = ["seed", "picks", "success_rate", "deadlocked", "loss", "epsilon"]
    _write_table(folder / "training_curves.csv", pd.concat(episodes)[columns])
    rows = [
        {"seed": seed, **training_summary(result), **_cost(record)}
        for seed, result, record in zip(seeds, results, records)
    ]
    _write_table(folder / "training_summary.csv", pd.DataFrame(rows))
    settings = {
        "picks": picks,
        "seeds": list(seeds),
        "evaluation": EVALUATION,
        "config": _shared(configs),
    }
    command = f"{COMMAND} training --picks {picks} --seeds {_listed(seeds)}"
    write_provenance(folder, "training", command, settings, picks < PAPER_PICKS, joined(records))


def training_summary(result: TrainResult) -> dict[str, float]:
    """What became of a training run.

    Returns:
        ``msr_start``, ``msr_end`` and ``msr_best``: the MSR while training over the first
        episode of all environments, the last hundredth of the picks (at least one episode),
        and the best episode. ``msr_mask``, ``msr_no_mask``: the MSR of the trained policy on
        50 fresh containers, told which items have failed or not, each with its standard
        deviation over the containers, and the share of picks in deadlocks without the mask.
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


def _shared(configs: dict[str, TrainConfig]) -> dict:
    """The fields of the configuration in which all runs agree."""
    fields = [asdict(config) for config in configs.values()]
    return {
        name: value
        for name, value in fields[0].items()
        if all(other[name] == value for other in fields)
    }


def _episodes(curve: pd.DataFrame) -> pd.DataFrame:
    """Means of a curve over each episode; all environments start theirs together."""
    points = task.MAX_PICKS // LOG_INTERVAL
    complete = curve[: len(curve) // points * points]
    groups = complete.groupby(complete.index // points)
    return groups.mean().assign(**groups[["picks", "wall_time", "epsilon"]].last())


def _rewards(curve: pd.DataFrame) -> pd.DataFrame:
    """Mean over the environments of the reward summed over each episode, as ``Value``."""
    episodes = _episodes(curve)
    return episodes.assign(Value=episodes["mean_reward"] * task.MAX_PICKS)


def _cost(record: dict) -> dict:
    """What a run took: its wall time and its peak memory."""
    return {name: record[name] for name in ("wall_time_s", "peak_memory_mib")}


def _write_table(path: Path, table: pd.DataFrame, digits: int = 6) -> None:
    files.write_text(path, table.to_csv(index=False, float_format=f"%.{digits}g"))


def _listed(values: Sequence) -> str:
    return " ".join(f"{value:g}" for value in values)


def _all_studies(experiments: Sequence[str] = EXPERIMENTS, n_jobs: int = -1) -> None:
    for experiment in experiments:
        study_data(experiment, n_jobs=n_jobs)


# Option → the parameter it sets, and how it is read.
OPTIONS = {
    "--jobs": ("n_jobs", {"type": int, "default": -1, "help": "processes; one per core if -1"}),
    "--picks": ("picks", {"type": int, "default": PAPER_PICKS}),
    "--seeds": ("seeds", {"type": int, "nargs": "+", "default": SEEDS}),
    "--learning-rates": (
        "learning_rates", {"type": float, "nargs": "+", "default": tuning.LEARNING_RATES}
    ),
    "--batch-sizes": ("batch_sizes", {"type": int, "nargs": "+", "default": tuning.BATCH_SIZES}),
    "--runs": ("runs", {"type": int, "default": tuning.RUNS, "help": "per configuration"}),
    "--steps": ("steps", {"type": int, "default": tuning.STEPS, "help": "of a run"}),
    "--experiments": (
        "experiments", {"nargs": "+", "choices": EXPERIMENTS, "default": tuple(EXPERIMENTS)}
    ),
    "--policies": ("names", {"nargs": "+", "choices": POLICIES, "default": POLICIES}),
}  # fmt: skip
# Part → what makes its data, and the options that it has.
PARTS: dict[str, tuple[Callable, tuple[str, ...]]] = {
    "lifts": (lift_data, ()),
    "agreement": (agreement_data, ("--jobs",)),
    "observation": (observation_data, ()),
    "tuning": (
        tuning_data, ("--learning-rates", "--batch-sizes", "--runs", "--steps", "--jobs")
    ),
    "training": (training_data, ("--picks", "--seeds", "--jobs")),
    "study": (_all_studies, ("--experiments", "--jobs")),
    "offline": (offline_data, ("--jobs",)),
    "comparison": (comparison_data, ("--policies", "--jobs")),
    "robustness": (robustness_data, ("--policies", "--jobs")),
}  # fmt: skip


def _paper(n_jobs: int) -> None:
    for make, options in PARTS.values():
        make(**({"n_jobs": n_jobs} if "--jobs" in options else {}))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parts = parser.add_subparsers(dest="part", required=True, metavar="part")
    for name, (make, options) in (PARTS | {"paper": (_paper, ("--jobs",))}).items():
        part = parts.add_parser(name, formatter_class=argparse.ArgumentDefaultsHelpFormatter)
        part.set_defaults(make=make)
        for option in options:
            parameter, how = OPTIONS[option]
            part.add_argument(option, dest=parameter, **how)
    chosen = vars(parser.parse_args())
    del chosen["part"]
    chosen.pop("make")(**chosen)


if __name__ == "__main__":
    main()
