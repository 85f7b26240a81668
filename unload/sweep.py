"""The hyperparameter grid of Sec. IV-A, and running many configurations at once."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path

import pandas as pd
import torch
from joblib import Parallel, delayed, parallel_config

from unload import checks, files, task
from unload.config import TrainConfig
from unload.train import train

LEARNING_RATES = (1e-1, 1e-2, 1e-3)
BATCH_SIZES = (64, 256, 1024, 2048)
RUNS = 10
STEPS = 3000  # K, one pick in each of 64 environments and one update per step


def tuning_config(
    batch_size: int,
    learning_rate: float,
    run: int,
    equalize: bool = True,
    steps: int = STEPS,
    **changes,
) -> TrainConfig:
    """One run in the hyperparameter-tuning environment (Sec. IV-A).

    Args:
        batch_size: b.
        learning_rate: μ.
        run: number of the run, its seed.
        equalize: with the paper's feature engineering or without.
        steps: K.
        **changes: further fields of ``TrainConfig``.
    """
    checks.integer("steps", steps, 1)
    return TrainConfig(
        env="unload/HighestItem-v0",
        picks=steps * task.NUM_ENVS,
        batch_size=batch_size,
        learning_rate=learning_rate,
        seed=run,
        equalize=equalize,
        log_interval=1,
        **changes,
    )


def tuning_grid(
    learning_rates: Sequence[float] = LEARNING_RATES,
    batch_sizes: Sequence[int] = BATCH_SIZES,
    runs: int = RUNS,
    equalize: Sequence[bool] = (True, False),
    steps: int = STEPS,
) -> list[TrainConfig]:
    """All runs of the paper's grid, short ones first."""
    return [
        tuning_config(batch_size, learning_rate, run, equalized, steps)
        for batch_size in sorted(batch_sizes)
        for run in range(checks.integer("runs", runs, 1))
        for equalized in equalize
        for learning_rate in learning_rates
    ]


def run_name(config: TrainConfig) -> str:
    """The paper's name of a tuning run, such as ``bz_64_lr_0.1_agent_3``."""
    return f"bz_{config.batch_size}_lr_{config.learning_rate:g}_agent_{config.seed}"


def set_name(equalize: bool) -> str:
    """The paper's name for the tuning runs with or without feature engineering."""
    return f"dummy_sim_{'with' if equalize else 'without'}_hist_equal"


def run_sweep(
    configs: Iterable[TrainConfig],
    folder: str | Path,
    n_jobs: int = -1,
    backend: str = "loky",
) -> pd.DataFrame:
    """Train many configurations side by side; finished ones are kept, broken ones resumed.

    A run that fails is reported and does not stop the others.

    Args:
        configs: the runs.
        folder: each run has a folder of its own in it.
        n_jobs: processes; -1 for one per core.
        backend: joblib's; ``"loky"`` for processes on this machine.

    Returns:
        One row per run, in the order given: ``folder`` of the run, ``error`` (what went
        wrong, or empty), and the configuration's fields.

    Raises:
        TypeError: one of ``configs`` is not a ``TrainConfig``.
        ValueError: two of them would share a folder.
    """
    configs = list(configs)
    for config in configs:
        if not isinstance(config, TrainConfig):
            raise TypeError(f"configs holds {config!r}; expected only unload.TrainConfig")
    folders = [run_folder(config, folder) for config in configs]
    for place, count in Counter(folders).items():
        if count > 1:
            raise ValueError(
                f"configs holds {count} runs for {str(place)!r}; expected runs that differ in "
                "batch size, learning rate, seed or equalization, or a folder for each"
            )
    with parallel_config(backend=backend, n_jobs=n_jobs):
        errors = Parallel()(delayed(_run)(*job) for job in zip(configs, folders))
    rows = [
        {"folder": str(place), "error": error, **asdict(config)}
        for config, place, error in zip(configs, folders, errors)
    ]
    return pd.DataFrame(rows)


def run_folder(config: TrainConfig, folder: str | Path) -> Path:
    """Where ``run_sweep`` keeps a run."""
    return Path(folder) / set_name(config.equalize) / run_name(config)


def _run(config: TrainConfig, folder: Path) -> str:
    """Train one configuration; the error's text if it failed."""
    torch.set_num_threads(1)  # the runs share the cores among themselves
    try:
        train(config, folder, progress=False)
    except Exception as error:  # whatever it was, the other runs go on
        return f"{type(error).__name__}: {error}"
    return ""


def export_curves(config: TrainConfig, run: str | Path, folder: str | Path) -> None:
    """Write a finished tuning run's curves as the paper's plots read them.

    ``folder/dummy_sim_{with,without}_hist_equal/{hitrate,loss}_curve_<name>.csv``: one value
    per step and no header; the loss before the first update is left empty.
    """
    curve = pd.read_csv(Path(run) / "curve.csv")
    for name, column in (("hitrate", "success_rate"), ("loss", "loss")):
        path = Path(folder) / set_name(config.equalize) / f"{name}_curve_{run_name(config)}.csv"
        files.write_text(path, curve[column].to_csv(index=False, header=False, float_format="%.5g"))
