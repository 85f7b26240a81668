"""The hyperparameter grid of Sec. IV-A, for Figs. 8–10: its runs, curves and summary.

Made by ``python -m unload.reproduce tuning``.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from unload import task
from unload.agent.config import TrainConfig
from unload.agent.sweep import run_all
from unload.agent.training import train
from unload.env.highest_item import GRID
from unload.reproduce.fingerprint import training_fingerprint
from unload.reproduce.results import COMMAND, JOBS, publish, shared_settings
from unload.support import checks, files

LEARNING_RATES = (1e-1, 1e-2, 1e-3)
BATCH_SIZES = (64, 256, 1024, 2048)
RUN_COUNT = 10  # of each configuration
STEPS = 3000  # K, one pick in each of 64 environments and one update per step

SMOOTHING_STEPS = 25  # of the running means
FINAL = 100  # steps at the end of a run that its final values are means of
SOLVED = 0.99  # MSR
REACHED = 0.9  # greedy MSR
LEAST_GREEDY = 0.05  # share of the picks from which the greedy MSR can be told
RESAMPLES = 500  # of the runs, for intervals
LOSSES = ("loss_start", "loss_dip", "loss_peak", "loss_end")

OPTIONS = {
    "--learning-rates": {"type": float, "nargs": "+", "default": LEARNING_RATES},
    "--batch-sizes": {"type": int, "nargs": "+", "default": BATCH_SIZES},
    "--runs": {"type": int, "default": RUN_COUNT, "help": "per configuration"},
    "--steps": {"type": int, "default": STEPS, "help": "of a run"},
    **JOBS,
}


def tuning_data(
    learning_rates: Sequence[float] = LEARNING_RATES,
    batch_sizes: Sequence[int] = BATCH_SIZES,
    runs: int = RUN_COUNT,
    steps: int = STEPS,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = -1,
    progress: bool = True,
) -> None:
    """Train every configuration with and without feature engineering; write their curves.

    The curves are those of ``export_curves``; ``tuning_summary.csv`` that of
    ``tuning_summary``.

    Args:
        learning_rates: μ.
        batch_sizes: b.
        runs: per configuration.
        steps: K.
        folder: of the data.
        runs_dir: where the runs are kept, apart from those of code that trained otherwise.
        n_jobs: processes, see ``run_sweep``.
        progress: show a progress bar.

    Raises:
        RuntimeError: a run failed; the message says which and why.
    """
    fingerprint = training_fingerprint()
    folder, kept = Path(folder), Path(runs_dir) / f"tuning/{fingerprint}/{steps}_steps"
    configs = tuning_grid(learning_rates, batch_sizes, runs, steps=steps)
    records = run_all(configs, kept, n_jobs, progress)
    curves = {name: train(config, kept / name).curve for name, config in configs.items()}
    for old in folder.glob("dummy_sim_*/*_curve_*.csv"):
        old.unlink()  # it may be of a run that is not among these
    for name, curve in curves.items():
        export_curves(name, curve, folder)
    settings = {
        "learning_rates": list(learning_rates),
        "batch_sizes": list(batch_sizes),
        "runs": runs,
        "steps": steps,
        "equalize": [True, False],
        "config": shared_settings(configs),
    }
    complete = set(LEARNING_RATES) <= set(learning_rates) and set(BATCH_SIZES) <= set(batch_sizes)
    publish(
        folder,
        "tuning",
        {"tuning_summary": tuning_summary(configs, curves)},
        f"{COMMAND} tuning --learning-rates {' '.join(map(str, learning_rates))} "
        f"--batch-sizes {' '.join(map(str, batch_sizes))} --runs {runs} --steps {steps}",
        settings,
        steps < STEPS or runs < RUN_COUNT or not complete,
        records,
        fingerprint,
    )


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
    runs: int = RUN_COUNT,
    equalize: Sequence[bool] = (True, False),
    steps: int = STEPS,
) -> dict[str, TrainConfig]:
    """All runs of the paper's grid, for ``run_sweep``.

    The slow ones, of large batches, come first, so that no process is left with one of them
    at the end. Each is named as the paper names its curves, such as
    ``dummy_sim_with_hist_equal/bz_64_lr_0.1_agent_3``.
    """
    return {
        f"{set_name(equalized)}/{run_name(batch_size, learning_rate, run)}": tuning_config(
            batch_size, learning_rate, run, equalized, steps
        )
        for batch_size in sorted(batch_sizes, reverse=True)
        for run in range(checks.integer("runs", runs, 1))
        for equalized in equalize
        for learning_rate in learning_rates
    }


def run_name(batch_size: int, learning_rate: float, run: int | str) -> str:
    """The paper's name of a tuning run, such as ``bz_64_lr_0.1_agent_3``."""
    return f"bz_{batch_size}_lr_{learning_rate:g}_agent_{run}"


def set_name(equalize: bool) -> str:
    """The paper's name for the tuning runs with or without feature engineering."""
    return f"dummy_sim_{'with' if equalize else 'without'}_hist_equal"


def export_curves(name: str, curve: pd.DataFrame, folder: str | Path) -> None:
    """Write a tuning run's curves as the paper's plots read them.

    ``folder/dummy_sim_{with,without}_hist_equal/{hitrate,loss}_curve_<run name>.csv``: one
    value per step and no header; the loss before the first update is ``nan``, which the plots
    leave out.

    Args:
        name: of the run in ``tuning_grid``.
        curve: of ``unload.train``.
        folder: of the data.
    """
    place = Path(folder) / name
    # A hit rate is a multiple of 1/64: six digits are exact.
    for kind, column, digits in (("hitrate", "success_rate", 6), ("loss", "loss", 4)):
        form = {"float_format": f"%.{digits}g", "na_rep": "nan"}
        text = curve[column].to_csv(index=False, header=False, **form)
        files.write_text(place.with_name(f"{kind}_curve_{place.name}.csv"), text)


def running_mean(values: np.ndarray) -> np.ndarray:
    """Means over 25 steps around each one, fewer at the ends; NaN does not count."""
    return pd.Series(values).rolling(SMOOTHING_STEPS, min_periods=1, center=True).mean().to_numpy()


def chance() -> float:
    """MSR of random picks in the tuning environment: the expected share of highest items.

    An item of a height is among the highest if none of the 127 others is higher.
    """
    heights, counts = np.unique(GRID[:, 2].round(6), return_counts=True)
    share = counts / counts.sum()
    return float((share * share.cumsum() ** (task.N_VISIBLE - 1)).sum())


def greedy_msr(success_rate: np.ndarray) -> np.ndarray:
    """The MSR that an agent's greedy picks had while it explored.

    Of the picks at a step a share ε is random, and succeeds by chance. Therefore
    MSR = (1 - ε) · greedy MSR + ε · chance, here solved for the greedy MSR with means over 25
    steps. The fewer picks are greedy, the noisier it is: it may leave [0, 1].

    Args:
        success_rate: (..., steps) MSR while training at each step of a whole run of
            ``tuning_config``.

    Returns:
        (..., steps), NaN where fewer than one pick in twenty is greedy.
    """
    steps = success_rate.shape[-1]
    config = tuning_config(1, 1, 0, steps=steps)
    epsilon = np.array([config.epsilon(step * task.NUM_ENVS) for step in range(steps)])
    greedy = running_mean(1 - epsilon)
    by_greedy = np.apply_along_axis(running_mean, -1, success_rate - epsilon * chance())
    return np.where(greedy < LEAST_GREEDY, np.nan, by_greedy / np.maximum(greedy, LEAST_GREEDY))


def reached_at(msr: np.ndarray, level: float = REACHED) -> np.ndarray:
    """The step from which on an MSR stays at ``level`` or above.

    Args:
        msr: (..., steps), NaN where it is not known.

    Returns:
        (...) float64, NaN if it does not end there.
    """
    below = ~(msr[..., ::-1] >= level)  # from the last step back; NaN counts as below
    since = np.where(below.any(axis=-1), below.argmax(axis=-1), msr.shape[-1])
    return np.where(since > 0, msr.shape[-1] - since, np.nan)


def greedy_reached(curves: Iterable[np.ndarray], level: float = REACHED) -> dict[str, float]:
    """When the mean greedy MSR of a configuration's runs reaches ``level``.

    The mean, because at that time one run alone has too few greedy picks.

    Args:
        curves: (steps,) MSR while training of each run.
        level: of the MSR.

    Returns:
        ``step``, see ``reached_at``, and ``low`` and ``high``, its 95 % bootstrap interval over
        the runs.
    """
    runs = greedy_msr(np.array(list(curves)))
    rng = np.random.default_rng(0)
    drawn = rng.integers(len(runs), size=(RESAMPLES, len(runs)))
    steps = reached_at(runs[drawn].mean(axis=1), level)
    low, high = np.nanpercentile(steps, [2.5, 97.5])
    return {"step": float(reached_at(runs.mean(axis=0), level)), "low": low, "high": high}


def run_summary(success_rate: np.ndarray, loss: np.ndarray) -> dict[str, float]:
    """How a tuning run ended, and its loss on the way.

    Args:
        success_rate: (steps,) MSR at each step.
        loss: (steps,) loss, NaN before the first update.

    Returns:
        ``final_msr``: mean over the last 100 steps. ``solved_at``: the first step from which
        on the running mean of the MSR stays at 99 % or above, NaN if it does not end there.
        ``loss_start``: the first loss; ``loss_dip`` and ``loss_peak``: where the running mean of
        the loss begins and ends its largest rise; ``loss_end``: mean over the last 100 steps.
        These are NaN if the run was too short for an update.
    """
    below = np.flatnonzero(running_mean(success_rate) < SOLVED)
    solved_at = below[-1] + 1 if below.size else 0
    return {
        "final_msr": success_rate[-FINAL:].mean(),
        "solved_at": solved_at if solved_at < len(success_rate) else np.nan,
        **_loss_summary(loss),
    }


def _loss_summary(loss: np.ndarray) -> dict[str, float]:
    known = np.isfinite(loss)
    if not known.any():
        return dict.fromkeys(LOSSES, np.nan)
    smooth = running_mean(loss)[known]
    lowest = np.minimum.accumulate(smooth)
    peak = np.argmax(smooth - lowest)
    ends = loss[known][0], lowest[peak], smooth[peak], loss[known][-FINAL:].mean()
    return dict(zip(LOSSES, ends))


def tuning_summary(
    configs: dict[str, TrainConfig], curves: dict[str, pd.DataFrame]
) -> pd.DataFrame:
    """One row per configuration: means over its runs of ``run_summary``.

    Columns: ``equalize``, ``batch_size``, ``learning_rate``, ``runs``; ``final_msr`` and its
    standard deviation, lowest and highest value; ``solved``, the number of runs that end at
    99 % or above, and ``solved_at`` of these; and the four losses.
    """
    rows = [
        {
            "equalize": config.equalize,
            "batch_size": config.batch_size,
            "learning_rate": config.learning_rate,
            **run_summary(curves[name]["success_rate"].to_numpy(), curves[name]["loss"].to_numpy()),
        }
        for name, config in configs.items()
    ]
    return (
        pd.DataFrame(rows)
        .groupby(["equalize", "batch_size", "learning_rate"])
        .agg(
            runs=("final_msr", "size"),
            final_msr=("final_msr", "mean"),
            final_msr_std=("final_msr", "std"),
            final_msr_min=("final_msr", "min"),
            final_msr_max=("final_msr", "max"),
            solved=("solved_at", "count"),
            solved_at=("solved_at", "mean"),
            **{name: (name, "mean") for name in LOSSES},
        )
        .reset_index()
    )
