"""What the plan in ``data/answer/PLAN.md`` asks of each run, and the statistics of a cell."""

from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd
from scipy import stats

from unload.agent.config import TrainConfig
from unload.support import checks

END = 0.1  # share of the picks at the end of a run
WINDOW_PICKS = 500_000
HIGH, LOW = 0.95, 0.8  # MSR that a fall begins at, and ends at
PAPER_MSR = 0.6  # at the end of its Fig. 12
LIKE_THE_PAPER = (0.5, 0.7)  # MSR at the end that counts as the paper's 60 %
LEVEL = 0.95  # of the intervals


def windows(curve: pd.DataFrame) -> pd.DataFrame:
    """Return the means of a curve over windows of half a million picks.

    Args:
        curve: ``picks`` (increasing), ``success_rate`` and ``loss``.
    """
    number = (curve["picks"] - 1) // WINDOW_PICKS
    return curve.groupby(number)[["success_rate", "loss"]].mean()


def end_msr(curve: pd.DataFrame) -> float:
    """Return the MSR while training over the last tenth of the picks."""
    last = curve["picks"].iloc[-1]
    return float(curve.loc[curve["picks"] > (1 - END) * last, "success_rate"].mean())


def falls(msr: Sequence[float]) -> list[tuple[int, int]]:
    """Return the falls of the MSR to 80 % or less after 95 % or more.

    Args:
        msr: of the windows.

    Returns:
        Of each fall, the last window that is high and the first one that is low.
    """
    found, high = [], None
    for window, value in enumerate(msr):
        if high is not None and value <= LOW:
            found.append((high, window))
            high = None
        if value >= HIGH:
            high = window
    return found


def replay_failures(curve: pd.DataFrame, replay_size: int = TrainConfig().replay_size) -> pd.Series:
    """Return the share of failures in the replay memory at each point of a curve.

    It is that of the last picks, because the memory holds these. Where it begins within a
    point, the point's failures are taken to be spread evenly.

    Args:
        curve: ``picks`` (increasing) and ``success_rate`` since the point before.
        replay_size: picks that the memory holds.
    """
    replay_size = checks.integer("replay_size", replay_size, 1)
    picks = np.append(0, curve["picks"])
    failed = np.append(0, np.cumsum((1 - curve["success_rate"]) * np.diff(picks)))
    first = np.maximum(picks - replay_size, 0)
    forgotten = np.interp(first, picks, failed)
    return pd.Series((failed - forgotten)[1:] / (picks - first)[1:], curve.index)


def fall_table(curve: pd.DataFrame, replay_size: int = TrainConfig().replay_size) -> pd.DataFrame:
    """Return one row per fall of a run (hypothesis 6).

    Args:
        curve: see ``windows``.
        replay_size: picks that the replay memory holds.

    Returns:
        ``begin`` and ``end``: picks at the ends of the last high and of the first low window;
        ``failures``: share of failures in the replay memory at the beginning.
    """
    share, rows = replay_failures(curve, replay_size), []
    for high, low in falls(windows(curve)["success_rate"]):
        begin, end = (WINDOW_PICKS * (window + 1) for window in (high, low))
        failures = np.interp(begin, curve["picks"], share)
        rows.append({"begin": begin, "end": end, "failures": failures})
    return pd.DataFrame(rows, columns=["begin", "end", "failures"])


def resembles_fig12(curve: pd.DataFrame) -> bool:
    """Whether the MSR rises steadily, and to about 60 %."""
    msr = windows(curve)["success_rate"].to_numpy()
    end = end_msr(curve)
    drop = (np.maximum.accumulate(msr) - msr).max()
    low, high = LIKE_THE_PAPER
    return bool(low <= end <= high and end >= msr[0] + 0.2 and drop <= 0.05)


def resembles_fig11(curve: pd.DataFrame) -> bool:
    """Whether the loss rises by a tenth from a minimum, and falls by a tenth afterwards."""
    loss = windows(curve)["loss"].dropna()
    peak = loss_peak(loss)
    return peak is not None and bool(loss.iloc[-1] <= 0.9 * loss[peak])


def loss_peak(loss: pd.Series) -> int | None:
    """Return the window of the highest loss after a rise by a tenth; None without such a rise.

    Args:
        loss: of the windows, without NaN.
    """
    risen = loss[loss >= 1.1 * loss.cummin()]
    return None if risen.empty else int(risen.idxmax())


def after_loss_peak(curve: pd.DataFrame) -> tuple[bool, bool]:
    """Return whether the MSR rises more slowly and is noisier after the loss's peak than before.

    Compared are the mean and the standard deviation of its changes from window to window; both
    are False if there are fewer than two changes before the peak or after it.
    """
    means = windows(curve)
    peak = loss_peak(means["loss"].dropna())
    if peak is None:
        return False, False
    changes = means["success_rate"].diff().dropna()
    before, after = changes[changes.index <= peak], changes[changes.index > peak]
    if min(len(before), len(after)) < 2:
        return False, False
    return bool(after.mean() < before.mean()), bool(after.std() > before.std())


def run_measures(curve: pd.DataFrame) -> dict:
    """Return the measures of one run: its end, its falls, and its likeness to the paper's."""
    msr = windows(curve)["success_rate"]
    figures = resembles_fig11(curve), resembles_fig12(curve)
    return {
        "end": end_msr(curve),
        "highest": msr.max(),
        "falls": len(falls(msr)),
        "fig11": figures[0],
        "fig12": figures[1],
        "both": all(figures),
    }


def t_interval(values: Sequence[float]) -> tuple[float, float]:
    """Return the 95 % t interval of the mean of (n,) values; NaN for fewer than two."""
    values = checks.finite_array("values", values, (None,))
    if len(values) < 2:
        return np.nan, np.nan
    error = stats.sem(values)
    if error == 0:
        return values[0], values[0]
    return tuple(map(float, stats.t.interval(LEVEL, len(values) - 1, values.mean(), error)))


def welch_interval(first: Sequence[float], second: Sequence[float]) -> tuple[float, float]:
    """Return the 95 % interval of the difference of two means, first minus second, by Welch.

    NaN if there are fewer than two values of either (hypotheses 2 and 3).
    """
    samples = [
        checks.finite_array(name, values, (None,))
        for name, values in (("first", first), ("second", second))
    ]
    if min(map(len, samples)) < 2:
        return np.nan, np.nan
    test = stats.ttest_ind(*samples, equal_var=False)
    return tuple(map(float, test.confidence_interval(LEVEL)))


def fisher_p(fallen: int, runs: int, control_fallen: int, control_runs: int) -> float:
    """Return the p-value of Fisher's one-sided test that fewer runs fall than in the control.

    Args:
        fallen, runs: how many runs with the change fell, of how many.
        control_fallen, control_runs: the same without it.

    Raises:
        TypeError, ValueError: a number is no integer, or more runs fell than there are.
    """
    rows = []
    for name, fell, total in (
        ("fallen", fallen, runs), ("control_fallen", control_fallen, control_runs)
    ):  # fmt: skip
        total = checks.integer(name.replace("fallen", "runs"), total, 1)
        fell = checks.integer(name, fell, 0, total)
        rows.append([fell, total - fell])
    return float(stats.fisher_exact(rows, alternative="less").pvalue)


def interquartile_mean(values: Sequence[float], axis: int = -1) -> float:
    """Return the mean without the lowest and the highest quarter."""
    return stats.trim_mean(values, 0.25, axis=axis)


def bca_interval(values: Sequence[float], seed: int = 0) -> tuple[float, float]:
    """Return the 95 % BCa bootstrap interval of the interquartile mean; NaN for fewer than four."""
    values = checks.finite_array("values", values, (None,))
    if len(values) < 4 or np.ptp(values) == 0:
        return np.nan, np.nan
    result = stats.bootstrap(
        (values,),
        interquartile_mean,
        confidence_level=LEVEL,
        method="BCa",
        rng=np.random.default_rng(seed),
    )
    return tuple(map(float, result.confidence_interval))


def cell_table(runs: Iterable[tuple[str, int, pd.DataFrame]]) -> pd.DataFrame:
    """Return one row per cell, with the statistics of the plan.

    Args:
        runs: cell, seed and curve of each, see ``unload.reproduce.answer.read_answer``.

    Returns:
        ``cell``, ``runs``, ``mean`` of the MSR over the last tenth with ``low`` and ``high``,
        ``iqm`` with ``iqm_low`` and ``iqm_high``; ``lowest`` and ``highest`` run; ``fell``, the
        runs that fall at least once; ``fig11``, ``fig12`` and ``both``, the runs like the
        paper's.
    """
    measured = pd.DataFrame([{"cell": cell, **run_measures(curve)} for cell, _, curve in runs])
    rows = []
    for cell, group in measured.groupby("cell", sort=False):
        ends = group["end"].to_numpy()
        rows.append(
            {"cell": cell, "runs": len(ends), "mean": ends.mean()}
            | dict(zip(("low", "high"), t_interval(ends)))
            | {"iqm": interquartile_mean(ends)}
            | dict(zip(("iqm_low", "iqm_high"), bca_interval(ends)))
            | {"lowest": ends.min(), "highest": ends.max(), "fell": int((group["falls"] > 0).sum())}
            | {name: int(group[name].sum()) for name in ("fig11", "fig12", "both")}
        )
    return pd.DataFrame(rows)
