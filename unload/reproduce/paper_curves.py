"""The paper's learning curves beside ours: numbers of the tuning and of the training.

Tables as those of ``paper_numbers``, computed from ``data/``.
"""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd

from unload import task
from unload.reproduce.answer import PAPER_CELLS, paper_runs
from unload.reproduce.paper_numbers import CHANCE_ERROR, Row, table
from unload.reproduce.tuning import (
    RUN_COUNT,
    greedy_reached,
    run_name,
    running_mean,
    set_name,
)
from unload.reproduce.verdict import (
    PAPER_MSR,
    WINDOW_PICKS,
    after_loss_peak,
    run_measures,
    t_interval,
    welch_interval,
    windows,
)
from unload.support import files

STEADY = 0.05  # MSR that a steady rise may lose
BATCH_SIZES = (64, 256, 1024, 2048)  # of the tuning runs
SETTLED = 200  # tuning steps after which the noise of the loss is measured


def tuning(folder: str | Path = files.DATA) -> pd.DataFrame:
    """The tuning environment: learning rates, batch sizes, feature engineering.

    Args:
        folder: of the data.
    """
    summary = pd.read_csv(Path(folder) / "tuning_summary.csv")
    summary = summary.set_index(["equalize", "batch_size", "learning_rate"])
    reached = {size: greedy_reached(_curves("hitrate", True, size, folder)) for size in BATCH_SIZES}
    noise = {size: loss_noise(True, size, folder) for size in BATCH_SIZES}
    return table(
        [
            *_learning_rates(summary),
            *_batches(summary, reached, noise),
            *_feature_engineering(summary, reached[2048], noise[2048], folder),
        ]
    )


def _learning_rates(summary: pd.DataFrame) -> list[Row]:
    rows = []
    for rate, claim in (
        (0.1, "unstable, in most cases unsuccessful"),
        (0.01, "the same"),
        (0.001, "successful"),
    ):
        runs = summary.loc[True, 1024, rate]
        here = f"{_solved(runs)}; MSR at the end {runs.final_msr:.0%}"
        agrees = (runs.solved > runs.runs / 2) == (rate == 0.001)
        rows.append(Row(f"tuning, b = 1024, μ = {rate:g}", "IV-A, Fig. 8", claim, here, agrees))
    return rows


def _batches(summary: pd.DataFrame, reached: dict, noise: dict) -> list[Row]:
    rows = [
        Row(
            f"tuning, b = {size}, μ = 0.001", "IV-A, Fig. 9", "a curve",
            f"{_solved(summary.loc[True, size, 0.001])}; {_since(reached[size])}; "
            f"noise of the loss {noise[size].mean():.4f}",
        )
        for size in BATCH_SIZES
    ]  # fmt: skip
    faster = "steps of the greedy MSR, above: b = 2048 against 64"
    return [
        *rows,
        Row(
            "… less noisy with larger b", "IV-A", "yes", "noise of the loss, above",
            all(t_interval(b)[1] < t_interval(a)[0] for a, b in pairwise(noise.values())),
        ),
        Row(
            "… faster with larger b", "IV-A", "yes", faster,
            reached[2048]["high"] < reached[64]["low"],
        ),
    ]  # fmt: skip


def _feature_engineering(
    summary: pd.DataFrame, reached: dict, noise: np.ndarray, folder: str | Path
) -> list[Row]:
    rows = []
    for equalized, label in ((True, "with FE"), (False, "without FE")):
        loss = summary.loc[equalized, 2048, 0.001]
        here = f"{loss.loss_start:.2f}, {loss.loss_dip:.2f}, {loss.loss_peak:.2f}"
        here += f", {loss.loss_end:.3f} at the end"
        agrees = loss.loss_start > loss.loss_dip < loss.loss_peak > loss.loss_end
        rows.append(
            Row(f"tuning, loss {label}", "IV-A, Fig. 10", "falls, rises, falls", here, agrees)
        )
    without = greedy_reached(_curves("hitrate", False, 2048, folder))
    spread = loss_noise(False, 2048, folder)
    low, high = welch_interval(noise, spread)
    return [
        *rows,
        Row(
            "… shorter with FE", "IV-A", "significantly",
            f"with FE, {_since(reached)}; without, from {_steps(without)} on",
            reached["high"] < without["low"],
        ),
        Row(
            "… more stable with FE", "IV-A", "yes",
            f"noise of the loss {noise.mean():.4f} with FE, {spread.mean():.4f} without "
            f"(difference {low:+.4f} to {high:+.4f})",
            "not shown" if low <= 0 <= high else high < 0,
        ),
    ]  # fmt: skip


def loss_noise(equalized: bool, batch_size: int, folder: str | Path = files.DATA) -> np.ndarray:
    """Return the standard deviation of the loss around its running mean, for each tuning run.

    Args:
        equalized: whether with feature engineering.
        batch_size: of the runs; their learning rate is the paper's.
        folder: of the data.
    """
    loss = _curves("loss", equalized, batch_size, folder)
    apart = loss - np.array([running_mean(run) for run in loss])
    return np.nanstd(apart[:, SETTLED:], axis=1)


def _curves(kind: str, equalized: bool, batch_size: int, folder: str | Path) -> np.ndarray:
    """The curves of all tuning runs with the paper's learning rate, (runs, steps)."""
    place = Path(folder) / set_name(equalized)
    names = [f"{kind}_curve_{run_name(batch_size, 1e-3, run)}.csv" for run in range(RUN_COUNT)]
    return np.array([np.loadtxt(place / name) for name in names if (place / name).is_file()])


def _solved(runs: pd.Series) -> str:
    return f"{runs.solved:.0f} of {runs.runs:.0f} runs end at 99 %"


def _steps(reached: dict) -> str:
    return f"{reached['step']:.0f} ({reached['low']:.0f}–{reached['high']:.0f})"


def _since(reached: dict) -> str:
    return f"greedy MSR above 90 % from step {_steps(reached)} on"


def training(folder: str | Path = files.DATA) -> pd.DataFrame:
    """The training, by the plan's measures in ``unload.reproduce.verdict``.

    Args:
        folder: of the data.
    """
    runs = paper_runs(folder)
    rows = _start(np.array([curve["success_rate"].iloc[0] for _, _, curve in runs]))
    tuned = np.mean([_decrease(loss) for loss in _tuning_losses(folder)])
    for cell, name in PAPER_CELLS.items():
        curves = [curve for each, _, curve in runs if each == cell]
        if len(curves) > 1:
            rows += _cell(f"{name}, {len(curves)} runs", curves, tuned)
    trained = pd.read_csv(Path(folder) / "training_summary.csv")
    for mask, column in (("without", "msr_no_mask"), ("with", "msr_mask")):
        label = f"MSR of the policies trained without the mask, b = 2048, applied {mask} it"
        msr = trained[column]
        rows.append(Row(label, "—", "—", f"{msr.mean():.0%} ({msr.min():.0%}–{msr.max():.0%})"))
    return table(rows)


def _start(msr: np.ndarray) -> list[Row]:
    """The first episodes of all runs: mean reward and MSR."""
    mean, reward = msr.mean(), 2 * msr.mean() - 1
    return [
        Row(
            "mean reward at the start (first episodes)", "IV-B, Fig. 12", "-0.7", f"{reward:.2f}",
            abs(reward + 0.7) < 2 * CHANCE_ERROR,
        ),
        Row(
            "MSR at the start (first episodes)", "IV-B", "15 %", f"{mean:.1%}",
            abs(mean - 0.15) < CHANCE_ERROR,
        ),
    ]  # fmt: skip


def _tuning_losses(folder: str | Path) -> list[pd.Series]:
    """The running mean of the loss of the tuning runs with the paper's values, by picks."""
    losses = _curves("loss", True, 2048, folder)
    picks = task.NUM_ENVS * np.arange(1, losses.shape[1] + 1)
    return [pd.Series(running_mean(loss), picks).dropna() for loss in losses]


def _decrease(loss: pd.Series) -> float:
    """Mean slope of the decrease after the peak, per million picks.

    The peak is where the largest rise ends; the loss is indexed by picks.
    """
    peak = (loss - loss.cummin()).idxmax()
    return 1e6 * (loss[peak] - loss.iloc[-1]) / max(loss.index[-1] - peak, 1)


def _cell(label: str, curves: list[pd.DataFrame], tuned: float) -> list[Row]:
    """The end, the rise and the loss of the runs of one cell.

    Args:
        label: of the cell.
        curves: of its runs.
        tuned: slope of the decrease of the loss in the tuning environment.
    """
    measured = pd.DataFrame([run_measures(curve) for curve in curves])
    end, (low, high) = measured["end"], t_interval(measured["end"])
    alike, half = int(measured["both"].sum()), len(curves) / 2
    means = [windows(curve) for curve in curves]
    msr = [each["success_rate"] for each in means]
    steady = sum((each.cummax() - each).max() <= STEADY for each in msr)
    like_11 = int(measured["fig11"].sum())
    losses = [each["loss"].dropna() for each in means]
    slopes = [_decrease(loss.set_axis(WINDOW_PICKS * (loss.index + 1))) for loss in losses]
    slower, noisier = np.sum([after_loss_peak(curve) for curve in curves], axis=0)
    holds = bool(low <= PAPER_MSR <= high)
    reproduced = holds if alike >= half or not holds else "in part"  # the plan's question 1
    return [
        Row(
            f"mean reward at the end: {label}", "IV-B, Fig. 12", "around 0.2",
            f"{2 * end.mean() - 1:.2f} (95 % t interval {2 * low - 1:.2f} to {2 * high - 1:.2f})",
            reproduced,
        ),
        Row(
            f"MSR at the end: {label}", "abstract, IV-B, V", "60 %",
            f"{end.mean():.0%} (95 % t interval {low:.0%} to {high:.0%}); "
            f"{alike} of {len(end)} runs like the paper's",
            reproduced,
        ),
        Row(
            f"steady rise: {label}", "IV-B", "yes", f"{steady} of {len(curves)} runs",
            steady >= half,
        ),
        Row(
            f"… slower and noisier after the loss's peak: {label}", "IV-B", "yes",
            f"slower in {slower}, noisier in {noisier} of {len(curves)} runs",
            min(slower, noisier) >= half,
        ),
        Row(
            f"loss: {label}", "IV-B, Fig. 11", "falls, rises, falls",
            f"{like_11} of {len(curves)} runs", like_11 >= half,
        ),
        Row(
            f"… its decrease slower than in tuning: {label}", "IV-B", "much lower slope",
            f"{np.mean(slopes):.3f} per million picks, {tuned:.2f} in tuning",
            max(slopes) < tuned,
        ),
    ]  # fmt: skip
