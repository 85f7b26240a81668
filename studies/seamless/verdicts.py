"""The measures of ``data/seamless/PLAN.md`` of the runs in seamless walls."""

import pandas as pd

from studies.statistics import LIKE_THE_PAPER, STEADY, end_msr, t_interval, windows

LIKE_THE_START = (0.13, 0.17)  # MSR over the first episode that counts as the paper's 15 %


def measures(run: pd.DataFrame) -> dict:
    """The plan's measures of one run.

    Args:
        run: its curve, a row per episode of all containers.

    Returns:
        ``start``, MSR over the first episode of all containers; ``end``, over the last tenth of
        the picks; ``best``, of the best window; ``drop``, how far a window lies below the best one
        before it; whether the run is like ``fig12`` and ``fig11``.
    """
    msr = windows(run)["success_rate"]
    drop = (msr.cummax() - msr).max()
    start, end = run["success_rate"].iloc[0], end_msr(run)
    starts_so = LIKE_THE_START[0] <= start <= LIKE_THE_START[1]
    ends_so = LIKE_THE_PAPER[0] <= end <= LIKE_THE_PAPER[1]
    return {
        "start": start,
        "end": end,
        "best": msr.max(),
        "drop": drop,
        "fig12": bool(starts_so and ends_so and drop <= STEADY),
        "fig11": like_fig11(run),
    }


def like_fig11(run: pd.DataFrame) -> bool:
    """Whether the loss falls, rises, and then sinks by less than half of what it rose."""
    loss = run["loss"].dropna()
    means = windows(run)["loss"].dropna()
    lowest, peak = loss.min(), means.max()
    falls_first = loss.idxmin() > loss.index[0] and loss.idxmin() < loss.index[len(loss) // 4]
    last = loss[run["picks"] > 0.9 * run["picks"].iloc[-1]].mean()
    return bool(falls_first and last < peak and peak - last < (peak - lowest) / 2)


def by_run(curves: pd.DataFrame) -> pd.DataFrame:
    """``measures`` of each run by ``cell`` and ``seed``, of curves as ``read_grid`` gives them."""
    groups = curves.groupby(["cell", "seed"], sort=False)
    rows = [{"cell": cell, "seed": seed, **measures(run)} for (cell, seed), run in groups]
    return pd.DataFrame(rows)


def by_cell(runs: pd.DataFrame) -> pd.DataFrame:
    """A row per cell of what ``by_run`` gives.

    Returns:
        The number of ``runs``; the mean ``start`` and ``end``; ``low`` and
        ``high``, the 95 % t interval of the end; ``lowest`` and ``highest`` end; the mean ``best``;
        how many runs lose at most 5 points (``steady``), and are like ``fig12`` and ``fig11``.
    """
    cells = runs.assign(steady=runs["drop"] <= STEADY).groupby("cell", sort=False)
    return cells.agg(
        runs=("end", "size"), start=("start", "mean"), end=("end", "mean"),
        low=("end", lambda end: t_interval(end)[0]), high=("end", lambda end: t_interval(end)[1]),
        lowest=("end", "min"), highest=("end", "max"), best=("best", "mean"),
        steady=("steady", "sum"), fig12=("fig12", "sum"), fig11=("fig11", "sum"),
    ).rename_axis(None)  # fmt: skip
