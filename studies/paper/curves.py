"""The paper's learning curves beside ours: numbers of the tuning and of the training.

Tables as those of ``numbers``, computed from ``data/``.
"""

from itertools import pairwise

import numpy as np
import pandas as pd

from studies.paper.numbers import CHANCE_ERROR, Row, table
from studies.paper.training import in_fresh_containers, paper_runs
from studies.paper.tuning import (
    BATCH_SIZES,
    greedy_reached,
    read_curves,
    running_mean,
    tuning_summary,
)
from studies.statistics import (
    PAPER_MSR,
    WINDOW_PICKS,
    cell_table,
    t_interval,
    welch_interval,
    windows,
)
from unload import task

SETTLED = 200  # tuning steps after which the noise of the loss is measured
CLAIMS = {  # of Fig. 8, by learning rate
    0.1: "unstable, in most cases unsuccessful",
    0.01: "the same",
    0.001: "successful",
}
CELLS = {
    "paper_no_mask": "without the mask, b = 256",
    "paper_mask": "with the mask, b = 256",
    "paper_b2048_no_mask": "without the mask, b = 2048",
    "paper_b2048_mask": "with the mask, b = 2048",
}


def tuning() -> pd.DataFrame:
    """The tuning environment: learning rates, batch sizes, feature engineering."""
    summary = tuning_summary().set_index(["equalize", "batch_size", "learning_rate"])
    reached, noise = {}, {}  # by batch size and feature engineering
    for key in [(size, True) for size in BATCH_SIZES] + [(2048, False)]:
        msr = read_curves("success_rate", key[0], 1e-3, key[1])
        reached[key] = greedy_reached(msr.values())
        noise[key] = loss_noise(read_curves("loss", key[0], 1e-3, key[1]))
    return table(
        [
            *_learning_rates(summary.loc[True, 1024]),
            *_batches(summary.loc[True], reached, noise),
            *_feature_engineering(summary.xs((2048, 0.001), level=(1, 2)), reached, noise),
        ]
    )


def loss_noise(losses: dict[int, np.ndarray]) -> np.ndarray:
    """Return the standard deviation of the loss around its running mean, of each tuning run."""
    return np.array([np.nanstd((loss - running_mean(loss))[SETTLED:]) for loss in losses.values()])


def _learning_rates(summary: pd.DataFrame) -> list[Row]:
    rows = []
    for rate, claim in CLAIMS.items():
        runs = summary.loc[rate]
        here = f"{_solved(runs)}; MSR at the end {runs.final_msr:.0%}"
        agrees = (runs.solved > runs.runs / 2) == (claim == "successful")
        rows.append(Row(f"tuning, b = 1024, μ = {rate:g}", "IV-A, Fig. 8", claim, here, agrees))
    return rows


def _batches(summary: pd.DataFrame, reached: dict, noise: dict) -> list[Row]:
    rows = []
    for size in BATCH_SIZES:
        here = f"{_solved(summary.loc[size, 0.001])}; {_since(reached[size, True])}"
        here += f"; noise of the loss {noise[size, True].mean():.4f}"
        rows.append(Row(f"tuning, b = {size}, μ = 0.001", "IV-A, Fig. 9", "a curve", here))
    spreads = [t_interval(noise[size, True]) for size in BATCH_SIZES]
    calmer = all(larger[1] < smaller[0] for smaller, larger in pairwise(spreads))
    faster = reached[2048, True]["high"] < reached[64, True]["low"]
    compared = "steps of the greedy MSR, above: b = 2048 against 64"
    return [
        *rows,
        Row("… less noisy with larger b", "IV-A", "yes", "noise of the loss, above", calmer),
        Row("… faster with larger b", "IV-A", "yes", compared, faster),
    ]


def _feature_engineering(summary: pd.DataFrame, reached: dict, noise: dict) -> list[Row]:
    rows = []
    for equalized, label in ((True, "with FE"), (False, "without FE")):
        loss = summary.loc[equalized]
        here = f"{loss.loss_start:.2f}, {loss.loss_dip:.2f}, {loss.loss_peak:.2f}"
        here += f", {loss.loss_end:.3f} at the end"
        agrees = loss.loss_start > loss.loss_dip < loss.loss_peak > loss.loss_end
        rows.append(
            Row(f"tuning, loss {label}", "IV-A, Fig. 10", "falls, rises, falls", here, agrees)
        )
    steps = reached[2048, True], reached[2048, False]
    spread = noise[2048, True], noise[2048, False]
    low, high = welch_interval(*spread)
    shorter = f"with FE, {_since(steps[0])}; without, from {_steps(steps[1])} on"
    calmer = f"noise of the loss {spread[0].mean():.4f} with FE, {spread[1].mean():.4f} without "
    calmer += f"(difference {low:+.4f} to {high:+.4f})"
    shown = "not shown" if low <= 0 <= high else high < 0
    return [
        *rows,
        Row(
            "… shorter with FE", "IV-A", "significantly", shorter,
            steps[0]["high"] < steps[1]["low"],
        ),
        Row("… more stable with FE", "IV-A", "yes", calmer, shown),
    ]  # fmt: skip


def _solved(runs: pd.Series) -> str:
    return f"{runs.solved:.0f} of {runs.runs:.0f} runs end at 99 %"


def _steps(reached: dict) -> str:
    return f"{reached['step']:.0f} ({reached['low']:.0f}–{reached['high']:.0f})"


def _since(reached: dict) -> str:
    return f"greedy MSR above 90 % from step {_steps(reached)} on"


def training() -> pd.DataFrame:
    """The training, by the first plan's measures, see ``studies.statistics``."""
    runs = paper_runs()
    rows = _start(np.array([curve["success_rate"].iloc[0] for _, _, curve in runs]))
    losses = read_curves("loss", 2048, 1e-3).values()
    tuned = np.mean([_tuning_decrease(loss) for loss in losses])
    for row in cell_table(runs).itertuples():
        slopes = [_training_decrease(curve) for cell, _, curve in runs if cell == row.cell]
        rows += _cell(f"{CELLS[row.cell]}, {row.runs} runs", row, slopes, tuned)
    applied = in_fresh_containers()
    for mask, column in (("without", "msr_no_mask"), ("with", "msr_mask")):
        label = f"MSR of the policies trained without the mask, b = 2048, applied {mask} it"
        msr = applied[column]
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


def _tuning_decrease(loss: np.ndarray) -> float:
    picks = task.NUM_ENVS * np.arange(1, len(loss) + 1)
    return decrease(pd.Series(running_mean(loss), picks).dropna())


def _training_decrease(curve: pd.DataFrame) -> float:
    loss = windows(curve)["loss"].dropna()
    return decrease(loss.set_axis(WINDOW_PICKS * (loss.index + 1)))


def decrease(loss: pd.Series) -> float:
    """Return the mean slope of the decrease after the peak, per million picks.

    The peak is where the largest rise ends; the loss is indexed by picks.
    """
    peak = (loss - loss.cummin()).idxmax()
    return 1e6 * (loss[peak] - loss.iloc[-1]) / max(loss.index[-1] - peak, 1)


def _cell(label: str, cell, slopes: list[float], tuned: float) -> list[Row]:
    """The end, the rise and the loss of the runs of one cell.

    Args:
        label: of the cell.
        cell: its row of ``cell_table``.
        slopes: of the decrease of the loss in its runs.
        tuned: the same in the tuning environment.
    """
    low, high, of_runs, half = cell.low, cell.high, f"of {cell.runs} runs", cell.runs / 2
    holds = bool(low <= PAPER_MSR <= high)
    reproduced = holds if cell.both >= half or not holds else "in part"  # the plan's question 1
    reward = f"{2 * cell.mean - 1:.2f} (95 % t interval {2 * low - 1:.2f} to {2 * high - 1:.2f})"
    msr = f"{cell.mean:.0%} (95 % t interval {low:.0%} to {high:.0%}); "
    msr += f"{cell.both} {of_runs} like the paper's"
    later = f"slower in {cell.slower}, noisier in {cell.noisier} {of_runs}"
    slope = f"{np.mean(slopes):.3f} per million picks, {tuned:.2f} in tuning"
    rows = [
        ("mean reward at the end", "IV-B, Fig. 12", "around 0.2", reward, reproduced),
        ("MSR at the end", "abstract, IV-B, V", "60 %", msr, reproduced),
        ("steady rise", "IV-B", "yes", f"{cell.steady} {of_runs}", cell.steady >= half),
        (
            "… slower and noisier after the loss's peak", "IV-B", "yes", later,
            min(cell.slower, cell.noisier) >= half,
        ),
        (
            "loss", "IV-B, Fig. 11", "falls, rises, falls", f"{cell.fig11} {of_runs}",
            cell.fig11 >= half,
        ),
        (
            "… its decrease slower than in tuning", "IV-B", "much lower slope", slope,
            max(slopes) < tuned,
        ),
    ]  # fmt: skip
    return [Row(f"{name}: {label}", *rest) for name, *rest in rows]
