"""Whether a run is like the paper's Figs. 11 and 12: one criterion, in the paper's words.

``data/ties/PLAN.md`` fixed it before its runs; it is applied to all runs of this repository.
"""

import numpy as np
import pandas as pd

from studies.statistics import END, WINDOW_PICKS, end_msr, fell, steady, window_numbers, windows

STARTS = (0.125, 0.175)  # MSR over the first episode: the paper's mean reward of −0.7
ENDS = (0.55, 0.65)  # MSR over the last tenth: "around 0.2"
FALL, RISE = 0.02, 0.1  # of the loss, as shares of what it was before
SLOWER = 0.5  # the slope of the last decrease, at most, as a share of that of the rise
FIG12 = ["starts", "steady", "slower", "noisier", "ends"]
FIG11 = ["loss_falls", "loss_rises", "loss_sinks"]
# The paper's words for each part, and what a run has to do; those for the loss are one row.
WORDS = {
    "starts": ("−0.7", "12.5–17.5 % in the first episode"),
    "steady": ("a steady increase", "no window is 5 points below an earlier one"),
    "slower": ("slower after the loss's peak", "a smaller mean change from then on"),
    "noisier": ("more noisy after it", "changes vary more from then on"),
    "ends": ("around 0.2", "55–65 % over the last tenth"),
    "fig11": ("decreases, increases, a lower slope", "it falls, rises, sinks at most half as fast"),
}
# Three readings of "noisier": what varies more after the peak of the loss than before it. The
# criterion is the first one; a plan fixed it. See ``noisier_readings``.
READINGS = {
    "windows": "changes from window to window",
    "scatter": "points around the trend of their window",
    "steps": "changes from point to point",
}


def likeness(curve: pd.DataFrame) -> dict:
    """Return the parts of the criterion that hold for a run.

    Args:
        curve: ``picks`` (increasing, the first row a whole episode of all containers),
            ``success_rate`` and ``loss``.

    Returns:
        ``start`` and ``end``, the MSR over the first row and over the last tenth; ``best``, of
        the best window; whether the run ``fell``; the parts in ``FIG12`` and ``FIG11``; and
        ``fig12``, ``fig11`` and ``both``, whether all of their parts hold.
    """
    means, start, end = windows(curve), float(curve["success_rate"].iloc[0]), end_msr(curve)
    changes = means["success_rate"].diff().dropna()
    peak = means["loss"].idxmax()
    before, after = changes[changes.index <= peak], changes[changes.index > peak]
    compared = min(len(before), len(after)) >= 2
    parts = {
        "starts": STARTS[0] <= start <= STARTS[1],
        "steady": steady(curve),
        "slower": compared and after.mean() < before.mean(),
        "noisier": compared and after.std() > before.std(),
        "ends": ENDS[0] <= end <= ENDS[1],
        **loss_parts(curve, means["loss"][peak], (peak + 0.5) * WINDOW_PICKS),
    }
    parts = {name: bool(holds) for name, holds in parts.items()}
    fig12, fig11 = all(map(parts.get, FIG12)), all(map(parts.get, FIG11))
    measures = {"start": start, "end": end, "best": float(means["success_rate"].max())}
    verdicts = {"fig12": fig12, "fig11": fig11, "both": fig12 and fig11}
    return measures | {"fell": fell(curve)} | parts | verdicts


def noisier_readings(curve: pd.DataFrame) -> dict[str, bool]:
    """Return whether the MSR is noisier after the loss's peak, by each of ``READINGS``.

    Args:
        curve: see ``likeness``.
    """
    late = window_numbers(curve) > windows(curve)["loss"].idxmax()
    varies = {"scatter": scatter(curve), "steps": curve["success_rate"].diff()}
    spreads = {name: (values[~late].std(), values[late].std()) for name, values in varies.items()}
    # Without a point after the peak its spread is NaN, and larger than nothing.
    noisier = {name: bool(after > before) for name, (before, after) in spreads.items()}
    return {"windows": likeness(curve)["noisier"], **noisier}


def scatter(curve: pd.DataFrame) -> pd.Series:
    """Return by how much each point's MSR differs from the straight line through its window's.

    Args:
        curve: ``picks`` and ``success_rate``, with at least two points in each window.
    """

    def line(rates: pd.Series) -> np.ndarray:
        places = np.arange(len(rates))
        return np.polyval(np.polyfit(places, rates, 1), places)

    rates = curve["success_rate"]
    return rates - rates.groupby(window_numbers(curve)).transform(line)


def open_course(share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest and the highest MSR that the paper's words leave open during a run.

    A steady rise that becomes slower lies above a straight one, and below where it ends.

    Args:
        share: (n,) float in [0, 1], of the run's picks.
    """
    low = STARTS[0] + (ENDS[0] - STARTS[0]) * share
    return low, np.where(share > 0, ENDS[1], STARTS[1])


def loss_parts(curve: pd.DataFrame, peak: float, at: float) -> dict:
    """Return the parts in ``FIG11`` that hold for a run.

    Args:
        curve: of the run.
        peak: the highest mean loss of a window.
        at: picks in the middle of that window.
    """
    curve = curve.dropna(subset="loss")
    first, before = curve["loss"].iloc[0], curve[curve["picks"] <= at]
    late = curve[curve["picks"] > (1 - END) * curve["picks"].iloc[-1]]
    lowest, end = before.loc[before["loss"].idxmin()], late["loss"].mean()
    rise = (peak - lowest["loss"]) / (at - lowest["picks"])
    fall = (peak - end) / (late["picks"].mean() - at)
    return {
        "loss_falls": lowest["loss"] <= (1 - FALL) * first,
        "loss_rises": peak >= (1 + RISE) * lowest["loss"],
        "loss_sinks": 0 < fall <= SLOWER * rise,
    }
