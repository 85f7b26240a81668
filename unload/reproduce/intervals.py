"""Confidence intervals of means over seeds or containers, and of shares."""

import warnings
from collections.abc import Callable, Sequence

import numpy as np
import pandas as pd
from scipy import stats

from unload.support import checks

RESAMPLES = 10_000
LEVEL = 0.95


def bootstrap_interval(
    values: Sequence[float], level: float = 0.95, seed: int = 0
) -> tuple[float, float]:
    """Percentile bootstrap interval of the mean.

    Few values make it too narrow: of normally distributed ones, an interval of level 0.95
    holds the true mean in 75 % of all cases with three values, 84 % with five, 89 % with ten.

    Args:
        values: (n,) one number per seed or container, n ≥ 1.
        level: share of the resampled means inside.
        seed: of the resampling.

    Returns:
        Lower and upper end.

    Raises:
        TypeError, ValueError: an argument is not as described.
    """
    values = checks.finite_array("values", values, (None,))
    checks.real("level", level, 0, 1)
    if not values.size:
        raise ValueError("values is empty; expected at least one number")
    rng = np.random.default_rng(checks.integer("seed", seed, 0))
    rows = rng.integers(values.size, size=(RESAMPLES, values.size))
    low, high = np.quantile(values[rows].mean(axis=1), [(1 - level) / 2, (1 + level) / 2])
    return float(low), float(high)


def share_interval(count: int, total: int, level: float = 0.95) -> tuple[float, float]:
    """Clopper–Pearson interval of a share: exact, two-sided.

    Of nothing in 300 independent trials, a share of up to 1.2 % may be true.

    Args:
        count: trials that came out so.
        total: all trials, at least 1.
        level: of the interval, in (0, 1).

    Returns:
        Lower and upper end.

    Raises:
        TypeError, ValueError: an argument is not as described.
    """
    count = checks.integer("count", count, 0, checks.integer("total", total, 1))
    if not 0 < checks.real("level", level, 0, 1) < 1:
        raise ValueError(f"level is {level}; expected a number in (0, 1)")
    interval = stats.binomtest(count, total).proportion_ci(level, method="exact")
    return float(interval.low), float(interval.high)


def with_intervals(table: pd.DataFrame, by: Sequence[str], measures: Sequence[str]) -> pd.DataFrame:
    """Mean and 95 % bootstrap interval of each measure over the rows of a group.

    Args:
        table: one row per seed or container.
        by: columns that make a group; the groups keep their order.
        measures: columns of numbers.

    Returns:
        One row per group: the columns ``by``, ``runs``, and for each measure its mean under
        its own name and the interval's ends as ``<measure>_low`` and ``<measure>_high``.

    Raises:
        TypeError, ValueError: a column is missing, or a measure is not finite.
    """
    checks.entries("table", dict(table), (*by, *measures))
    rows = []
    for key, group in table.groupby(list(by), sort=False):
        row = dict(zip(by, key)) | {"runs": len(group)}
        for name in measures:
            low, high = bootstrap_interval(group[name].to_numpy())
            row |= {name: group[name].mean(), f"{name}_low": low, f"{name}_high": high}
        rows.append(row)
    return pd.DataFrame(rows)


def mean_interval(values: Sequence[float], seed: int = 0) -> tuple[float, float, float]:
    """Mean, and its 95 % BCa bootstrap interval; equal values have one of no width."""
    values = checks.finite_array("values", values, (None,))
    if np.ptp(values) < 1e-12:
        return (float(values.mean()),) * 3
    return float(values.mean()), *_bca((values,), np.mean, seed)


def ratio_interval(
    values: Sequence[float], reference: Sequence[float], seed: int = 0
) -> tuple[float, float, float]:
    """Ratio of two means over the same heaps, and its 95 % BCa bootstrap interval over pairs.

    NaN where the reference's mean is not > 0 in every resample, because such a ratio means
    nothing. If all pairs have the same ratio, the interval has no width.
    """
    values = checks.finite_array("values", values, (None,))
    reference = checks.finite_array("reference", reference, values.shape)
    rows = np.random.default_rng(seed).integers(len(values), size=(RESAMPLES, len(values)))
    if (reference[rows].mean(axis=1) <= 0).any():
        return np.nan, np.nan, np.nan
    ratio = float(values.mean() / reference.mean())
    if np.abs(values - ratio * reference).max() < 1e-12:
        return ratio, ratio, ratio
    return ratio, *_bca((values, reference), _ratio, seed)


def _ratio(values: np.ndarray, reference: np.ndarray, axis: int) -> np.ndarray:
    return values.mean(axis=axis) / reference.mean(axis=axis)


def _bca(samples: tuple[np.ndarray, ...], statistic: Callable, seed: int) -> tuple[float, float]:
    """BCa interval of a statistic of one sample, or of pairs; NaN of fewer than two values."""
    if len(samples[0]) < 2:
        return np.nan, np.nan
    with warnings.catch_warnings():  # samples of few different values: the interval is NaN
        warnings.simplefilter("ignore")
        interval = stats.bootstrap(
            samples, statistic, n_resamples=RESAMPLES, paired=True, confidence_level=LEVEL,
            method="BCa", vectorized=True, axis=-1, rng=np.random.default_rng(seed),
        ).confidence_interval  # fmt: skip
    return float(interval.low), float(interval.high)
