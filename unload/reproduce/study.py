"""Why 60 %? Controlled experiments on the paper's training.

    python -m unload.reproduce study

Each experiment is a set of training runs that differ from the paper's configuration in what
is under test and in the seed, and in what makes them affordable: fewer picks, and a batch of
256, for an update eight times cheaper; the search shows what the batch changes. Networks
without a fused update are small, too, and compared with the paper's at their size.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from itertools import product
from pathlib import Path

import pandas as pd
from joblib import Parallel, delayed

from unload.agent.config import TrainConfig
from unload.agent.sweep import run_all
from unload.agent.weights import load_policy, save_policy
from unload.reproduce import measure
from unload.reproduce.fingerprint import training_fingerprint
from unload.reproduce.results import COMMAND, JOBS, publish, read_table
from unload.support import checks, files

# What the network sees of an item's position.
FEATURE_SETTINGS = {
    "positions": {"equalize": False},  # scaled
    "noisy ranks": {"equalize": True, "ties": "noise"},  # equalized, as in the paper
    "tied ranks": {"equalize": True, "ties": "average"},
}
FLOORS = (0.0, 0.05)  # of the exploration rate
BASE = TrainConfig(batch_size=256, snapshots=20)


def factorial(picks: int = 2_000_000, seeds: int = 5) -> dict[str, TrainConfig]:
    """Features × mask in training × exploration floor."""
    cells = product(FEATURE_SETTINGS, (False, True), FLOORS, range(seeds))
    return {
        f"{features}/{'mask' if mask else 'no mask'}/floor {floor:g}/seed_{seed}": replace(
            BASE,
            picks=picks,
            seed=seed,
            mask=mask,
            epsilon_final=floor,
            **FEATURE_SETTINGS[features],
        )
        for features, mask, floor, seed in cells
    }


def search(picks: int = 1_000_000, seeds: int = 3) -> dict[str, TrainConfig]:
    """One setting at a time, with the paper's features."""
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
    return _varied(changes, ("noisy ranks",), picks, seeds)


def rewards(picks: int = 1_000_000, seeds: int = 3) -> dict[str, TrainConfig]:
    """The paper's outlook: failing at a higher item is less bad."""
    changes = [{"height_reward": share} for share in (0.0, 0.25, 0.5, 0.9)]
    return _varied(changes, ("noisy ranks",), picks, seeds)


SMALL = {"n_features": 32, "batch_size": 64}  # affordable without a fused update


def networks(picks: int = 320_000, seeds: int = 3) -> dict[str, TrainConfig]:
    """Other networks, all of them small."""
    changes = [{"network": name} | SMALL for name in ("peq", "two_layer", "stack")]
    return _varied(changes, ("noisy ranks",), picks, seeds)


def attention(picks: int = 320_000, seeds: int = 2) -> dict[str, TrainConfig]:
    """One more network, on its own: to train and to measure it takes five times as long."""
    change = {"network": "attention"} | SMALL | {"snapshots": 4}
    return _varied([change], ("noisy ranks",), picks, seeds)


def long(picks: int = 20_000_000, seeds: int = 3) -> dict[str, TrainConfig]:
    """The best cell of the factorial study for as long as the paper trained."""
    return _varied([{}], ("positions",), picks, seeds)


def recommended(picks: int = 1_000_000, seeds: int = 5) -> dict[str, TrainConfig]:
    """The paper's configuration but for one thing, and shorter: positions, not ranks."""
    return _varied([{"batch_size": TrainConfig().batch_size}], ("positions",), picks, seeds)


EXPERIMENTS: dict[str, Callable[..., dict[str, TrainConfig]]] = {
    experiment.__name__: experiment
    for experiment in (factorial, recommended, rewards, search, networks, attention, long)
}
OPTIONS = {
    "--experiments": {"nargs": "+", "choices": EXPERIMENTS, "default": tuple(EXPERIMENTS)},
    **JOBS,
}


def _varied(
    changes: list[dict], features: tuple[str, ...], picks: int, seeds: int
) -> dict[str, TrainConfig]:
    """A run for each change, features and seed."""
    return {
        f"{name}/{_name(change)}/seed_{seed}": replace(
            BASE, picks=picks, seed=seed, **FEATURE_SETTINGS[name], **change
        )
        for name, change, seed in product(features, changes, range(seeds))
    }


def _name(change: dict) -> str:
    return ", ".join(f"{field} {value}" for field, value in change.items()) or "base"


def features_of(config: TrainConfig) -> str:
    """The name in ``FEATURE_SETTINGS`` of what a configuration lets the network see."""
    if not config.equalize:
        return "positions"
    return {"noise": "noisy ranks", "average": "tied ranks"}[config.ties]


def study_data(
    experiment: str,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = -1,
    progress: bool = True,
    **size: int,
) -> None:
    """Make an experiment: ``study/<experiment>.csv`` and ``study/<experiment>_curves.csv``.

    They hold the rows and curves of ``measure_run``, with each run's name in ``run``, and in
    the rows its ``features``, a name in ``FEATURE_SETTINGS``. The recommended agent's first
    run also leaves ``policies/recommended.safetensors``.

    Args:
        experiment: a name in ``EXPERIMENTS``.
        folder: of the data.
        runs_dir: where the runs are kept, apart from those of code that trained otherwise.
        n_jobs: processes, see ``run_sweep``.
        progress: show a progress bar.
        **size: ``picks`` and ``seeds`` of the experiment, if not its own.

    Raises:
        ValueError: an unknown experiment.
        RuntimeError: a run failed; the message says which and why.
    """
    checks.one_of("experiment", experiment, EXPERIMENTS)
    configs = EXPERIMENTS[experiment](**size)
    fingerprint = training_fingerprint(config.network for config in configs.values())
    kept, folder = Path(runs_dir) / "study" / experiment / fingerprint, Path(folder)
    records = run_all(configs, kept, n_jobs, progress)
    measured = Parallel(n_jobs)(
        delayed(measure.measure_run)(config, kept / name) for name, config in configs.items()
    )
    rows = [
        {"run": name, "features": features_of(config), **row}
        for (name, config), (row, _) in zip(configs.items(), measured)
    ]
    curves = [curve.assign(run=name) for name, (_, curve) in zip(configs, measured)]
    if experiment == "recommended":
        best = load_policy(kept / next(iter(configs)) / "policy.safetensors")
        save_policy(best, folder / "policies" / "recommended.safetensors")
    settings = {
        "loads": measure.POLICY_LOADS,
        "loads_seed": measure.LOADS_SEED,
        "snapshot_loads": measure.SNAPSHOT_LOADS,
    }
    publish(
        folder / "study",
        experiment,
        {experiment: pd.DataFrame(rows), f"{experiment}_curves": pd.concat(curves)},
        f"{COMMAND} study --experiments {experiment}",
        settings | size,
        bool(size),
        records,
        fingerprint,
    )


def studies_data(experiments: Sequence[str] = tuple(EXPERIMENTS), n_jobs: int = -1) -> None:
    """Make several experiments, see ``study_data``."""
    for experiment in experiments:
        study_data(experiment, n_jobs=n_jobs)


def read_study(
    experiment: str, folder: str | Path = files.DATA
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """An experiment's rows and curves; the curves have the rows' settings beside them.

    Raises:
        ValueError: an unknown experiment.
        FileNotFoundError: the experiment has not been made.
    """
    checks.one_of("experiment", experiment, EXPERIMENTS)
    command = f"{COMMAND} study --experiments {experiment}"
    rows, curves = (
        read_table(Path(folder) / "study" / f"{experiment}{name}.csv", command, ["run"])
        for name in ("", "_curves")
    )
    settings = ["run", "features", *(name for name in asdict(TrainConfig()) if name in rows)]
    settings.remove("picks")  # of the whole run; the curve's are those so far
    return rows, curves.merge(rows[settings], on="run")
