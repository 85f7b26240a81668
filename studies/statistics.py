"""How a run ends and falls, whether it is like the paper's, and how sure means and shares are."""

import re
import warnings
from collections.abc import Callable, Sequence

import numpy as np
import pandas as pd
from scipy import stats

from studies import paths

END = 0.1  # share of the picks at the end of a run
WINDOW_PICKS = 500_000
HIGH, LOW = 0.95, 0.8  # MSR that a fall begins at, and ends at
STEADY = 0.05  # MSR that a steady rise may lose
PAPER_START, PAPER_MSR = 0.15, 0.6  # at the start and at the end of its Fig. 12
LIKE_THE_START = (0.13, 0.17)  # MSR over the first episode that counts as the paper's 15 %
LIKE_THE_PAPER = (0.5, 0.7)  # MSR at the end that counts as the paper's 60 %
LEVEL = 0.95  # of the intervals
RESAMPLES = 10_000


def windows(curve: pd.DataFrame) -> pd.DataFrame:
    """Return the means of a curve over windows of half a million picks.

    Args:
        curve: ``picks`` (increasing), ``success_rate`` and ``loss``.
    """
    return curve.groupby(window_numbers(curve))[["success_rate", "loss"]].mean()


def window_numbers(curve: pd.DataFrame) -> pd.Series:
    """Return the number of the window of half a million picks that each point belongs to."""
    return (curve["picks"] - 1) // WINDOW_PICKS


def end_msr(curve: pd.DataFrame) -> float:
    """Return the MSR while training over the last tenth of the picks."""
    last = curve["picks"].iloc[-1]
    return float(curve.loc[curve["picks"] > (1 - END) * last, "success_rate"].mean())


def fell(curve: pd.DataFrame) -> bool:
    """Whether a window's MSR is 80 % or less after an earlier one's was 95 % or more."""
    msr = windows(curve)["success_rate"]
    return bool(((msr >= HIGH).cummax() & (msr <= LOW)).any())


def resembles_fig12(curve: pd.DataFrame) -> bool:
    """Whether the MSR rises steadily, and to about 60 %."""
    end, (low, high) = end_msr(curve), LIKE_THE_PAPER
    rises = end >= windows(curve)["success_rate"].iloc[0] + 0.2
    return bool(low <= end <= high and rises and steady(curve))


def steady(curve: pd.DataFrame) -> bool:
    """Whether no window's MSR lies more than five points below an earlier one's."""
    msr = windows(curve)["success_rate"]
    return bool((msr.cummax() - msr).max() <= STEADY)


def resembles_fig11(curve: pd.DataFrame) -> bool:
    """Whether the loss rises by a tenth from a minimum, and falls by a tenth afterwards."""
    loss = windows(curve)["loss"].dropna()
    risen = loss[loss >= 1.1 * loss.cummin()]
    return bool(loss.iloc[-1] <= 0.9 * risen.max())  # NaN without such a rise


def first_plan(curve: pd.DataFrame) -> dict:
    """Return the measures of one run in ``data/falls/FIRST_PLAN.md``.

    Returns:
        ``end``, the MSR over the last tenth; whether the run ``fell`` at least once and rises
        ``steady``; whether it is like the paper's ``fig11``, ``fig12`` and ``both``.
    """
    fig11, fig12 = resembles_fig11(curve), resembles_fig12(curve)
    return {
        "end": end_msr(curve),
        "fell": fell(curve),
        "steady": steady(curve),
        "fig11": fig11,
        "fig12": fig12,
        "both": fig11 and fig12,
    }


def seamless_plan(curve: pd.DataFrame) -> dict:
    """Return the measures of one run in ``data/seamless/PLAN.md``.

    Args:
        curve: a row per episode of all containers.

    Returns:
        ``start``, MSR over the first episode of all containers; ``end``, over the last tenth of
        the picks; ``best``, of the best window; whether the run is ``steady`` and like ``fig12``
        and ``fig11``.
    """
    start, end, rises = curve["success_rate"].iloc[0], end_msr(curve), steady(curve)
    starts_so = LIKE_THE_START[0] <= start <= LIKE_THE_START[1]
    ends_so = LIKE_THE_PAPER[0] <= end <= LIKE_THE_PAPER[1]
    return {
        "start": start,
        "end": end,
        "best": windows(curve)["success_rate"].max(),
        "steady": rises,
        "fig12": bool(starts_so and ends_so and rises),
        "fig11": loss_rises_for_good(curve),
    }


def loss_rises_for_good(curve: pd.DataFrame) -> bool:
    """Whether the loss falls, rises, and then sinks by less than half of what it rose."""
    loss = curve["loss"].dropna()
    means = windows(curve)["loss"].dropna()
    lowest, peak = loss.min(), means.max()
    falls_first = loss.idxmin() > loss.index[0] and loss.idxmin() < loss.index[len(loss) // 4]
    last = loss[curve["picks"] > 0.9 * curve["picks"].iloc[-1]].mean()
    return bool(falls_first and last < peak and peak - last < (peak - lowest) / 2)


def by_run(curves: pd.DataFrame, plan: Callable[[pd.DataFrame], dict]) -> pd.DataFrame:
    """A plan's measures of each run by ``cell`` and ``seed``, of curves as of ``read_grid``."""
    groups = curves.groupby(["cell", "seed"], sort=False)
    return pd.DataFrame([{"cell": cell, "seed": seed, **plan(run)} for (cell, seed), run in groups])


def by_cell(runs: pd.DataFrame) -> pd.DataFrame:
    """A row per cell of what ``by_run`` gives.

    Returns:
        The number of ``runs``; the mean ``end`` with ``low`` and ``high``, its 95 % t interval;
        the ``lowest`` and ``highest`` end; of all other measures the mean, or the number of runs
        that they hold for.
    """
    cells = runs.groupby("cell", sort=False)
    ends = cells["end"].agg(
        runs="size",
        end="mean",
        low=lambda values: t_interval(values)[0],
        high=lambda values: t_interval(values)[1],
        lowest="min",
        highest="max",
    )
    others = runs.dtypes.drop(["cell", "seed", "end"])
    return ends.join(
        cells.agg({name: "sum" if kind == "bool" else "mean" for name, kind in others.items()})
    )


def t_interval(values: Sequence[float]) -> tuple[float, float]:
    """Return the 95 % t interval of the mean of (n,) values; NaN for fewer than two."""
    values = np.asarray(values, float)
    if len(values) < 2:
        return np.nan, np.nan
    error = stats.sem(values)
    if error == 0:
        return values[0], values[0]
    return tuple(map(float, stats.t.interval(LEVEL, len(values) - 1, values.mean(), error)))


def mean_interval(values: Sequence[float]) -> tuple[float, float, float]:
    """Mean, and its 95 % BCa bootstrap interval; equal values have one of no width."""
    return ratio_interval(values, np.ones(len(values)))


def ratio_interval(
    values: Sequence[float], reference: Sequence[float]
) -> tuple[float, float, float]:
    """Ratio of two means of paired values, and its 95 % BCa bootstrap interval over pairs.

    NaN where the reference's mean is not > 0 in every resample, because such a ratio means
    nothing. If all pairs have the same ratio, the interval has no width. Of fewer than two pairs,
    its ends are NaN.
    """
    values, reference = np.asarray(values, float), np.asarray(reference, float)
    rows = np.random.default_rng(0).integers(len(values), size=(RESAMPLES, len(values)))
    if (reference[rows].mean(axis=1) <= 0).any():
        return np.nan, np.nan, np.nan
    ratio = float(values.mean() / reference.mean())
    if len(values) < 2:
        return ratio, np.nan, np.nan
    if np.abs(values - ratio * reference).max() < 1e-12:
        return ratio, ratio, ratio

    def ratios(values: np.ndarray, reference: np.ndarray, axis: int) -> np.ndarray:
        return values.mean(axis=axis) / reference.mean(axis=axis)

    with warnings.catch_warnings():  # samples of few different values: the interval is NaN
        warnings.simplefilter("ignore")
        low, high = stats.bootstrap(
            (values, reference), ratios, n_resamples=RESAMPLES, paired=True, method="BCa",
            confidence_level=LEVEL, vectorized=True, axis=-1, rng=np.random.default_rng(0),
        ).confidence_interval  # fmt: skip
    return ratio, float(low), float(high)


def share_interval(count: int, total: int) -> tuple[float, float]:
    """Return the 95 % Clopper–Pearson interval of a share: exact, two-sided.

    Of nothing in 300 independent trials, a share of up to 1.2 % may be true.

    Args:
        count: trials that came out so.
        total: all trials, at least 1.
    """
    interval = stats.binomtest(count, total).proportion_ci(LEVEL, method="exact")
    return float(interval.low), float(interval.high)


def predictions(plan: str) -> pd.Series:
    """What ``data/<plan>/PLAN.md`` predicts in its tables, by names such as ``"A1"``."""
    text = (paths.DATA / plan / "PLAN.md").read_text(encoding="utf-8")
    return pd.Series(dict(re.findall(r"^\| ([A-Z]\d+) \| (.+?) \|", text, re.M)), name="predicted")
