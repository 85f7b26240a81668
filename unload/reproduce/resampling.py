"""How far few runs can mislead: samples drawn again from runs that were made.

The runs that are there stand for all runs that could be made. What a study of n runs would have
concluded is then known for every sample, and so is how often it would have been wrong.
"""

import warnings
from collections.abc import Sequence

import numpy as np
import pandas as pd
from scipy import stats

from unload.reproduce.verdict import LEVEL, t_interval
from unload.support import checks

BOOTSTRAPS = 999  # of each interval
BATCH = 100  # samples whose bootstraps are drawn at a time


def coverage(
    values: Sequence[float], counts: Sequence[int], rng: np.random.Generator, resamples: int = 1000
) -> pd.DataFrame:
    """Return how often 95 % intervals of the mean hold the mean that the samples come from.

    Args:
        values: (m,) what the samples are drawn from, with replacement; their mean is the truth.
        counts: sizes of the samples, each at least 2.
        rng: the source of randomness.
        resamples: samples of each size.

    Returns:
        One row per size and kind of interval: ``runs``, ``interval`` ("t", "percentile" or
        "BCa"), ``covered`` and ``width``, the median. A sample of equal values has no BCa
        interval, which counts as not covered.

    Raises:
        TypeError, ValueError: an argument is not as described.
    """
    values = _values(values)
    counts = [checks.integer("counts", count, 2) for count in counts]
    checks.generator("rng", rng)
    checks.integer("resamples", resamples, 1)
    truth, rows = values.mean(), []
    for count in counts:
        samples = rng.choice(values, (resamples, count))
        for name, (low, high) in _intervals(samples, rng).items():
            covered = (low <= truth) & (truth <= high)
            rows.append(
                {
                    "runs": count,
                    "interval": name,
                    "covered": covered.mean(),
                    "width": pd.Series(high - low).median(),
                }
            )
    return pd.DataFrame(rows)


def _intervals(samples: np.ndarray, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Kind → (2, samples) ends of the 95 % interval of the mean of each row."""
    found = {"t": np.array([t_interval(row) for row in samples]).T}
    for method in ("percentile", "BCa"):
        parts = []
        for first in range(0, len(samples), BATCH):
            with warnings.catch_warnings():  # equal values: the interval is NaN
                warnings.simplefilter("ignore")
                result = stats.bootstrap(
                    (samples[first : first + BATCH],), np.mean, n_resamples=BOOTSTRAPS, axis=-1,
                    confidence_level=LEVEL, method=method, rng=rng,
                )  # fmt: skip
            parts.append(result.confidence_interval)
        found[method] = np.concatenate(parts, axis=1)
    return found


def false_alarms(
    values: Sequence[float],
    first: int,
    last: int,
    rng: np.random.Generator,
    resamples: int = 2000,
    level: float = 0.05,
) -> pd.DataFrame:
    """Return how often two groups of runs "differ" that are drawn from the same runs.

    Welch's test is made once n runs are there of each group, for n from ``first`` to ``last``.

    Args:
        values: (m,) what both groups are drawn from, with replacement.
        first, last: runs of each group at the first test and at the last, 2 ≤ first ≤ last.
        rng: the source of randomness.
        resamples: pairs of groups.
        level: p below which a test is an alarm.

    Returns:
        One row per n: ``runs``; ``planned``, the share of pairs with an alarm at n; and
        ``peeking``, that of pairs with an alarm at n or at an earlier test.

    Raises:
        TypeError, ValueError: an argument is not as described.
    """
    values = _values(values)
    checks.integer("first", first, 2)
    checks.integer("last", last, first)
    checks.generator("rng", rng)
    checks.integer("resamples", resamples, 1)
    checks.real("level", level, 0, 1)
    groups = rng.choice(values, (2, resamples, last))
    alarmed, rows = np.zeros(resamples, bool), []
    for count in range(first, last + 1):
        with warnings.catch_warnings():  # groups of equal values have no p, and raise no alarm
            warnings.simplefilter("ignore")
            test = stats.ttest_ind(*groups[:, :, :count], axis=-1, equal_var=False)
        now = test.pvalue < level
        alarmed |= now
        rows.append({"runs": count, "planned": now.mean(), "peeking": alarmed.mean()})
    return pd.DataFrame(rows)


def _values(values: Sequence[float]) -> np.ndarray:
    values = checks.finite_array("values", values, (None,))
    if not values.size:
        raise ValueError("values is empty; expected at least one number")
    return values
