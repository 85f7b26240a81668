"""The practice of research: what windows, seeds, intervals and peeking do to a verdict."""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from unload.reproduce.figures.style import styled
from unload.reproduce.verdict import LEVEL, PAPER_MSR, WINDOW_PICKS, windows

MARKERS = "o", "s", "^"


@styled
def run_curves(groups: Mapping[str, Sequence[pd.DataFrame]]) -> Figure:
    """MSR while training over windows of half a million picks: a panel for each group of runs.

    Args:
        groups: title → curves with ``picks``, ``success_rate`` and ``loss``.
    """
    figure, panels = plt.subplots(
        1, len(groups), figsize=(2.9 * len(groups) + 0.5, 2.6), sharex=True, sharey=True,
        squeeze=False,
    )  # fmt: skip
    for axes, (title, curves) in zip(panels.flat, groups.items()):
        for number, curve in enumerate(curves):
            msr = windows(curve)["success_rate"]
            middles = (msr.index + 0.5) * WINDOW_PICKS / 1e6
            colour = plt.get_cmap("viridis")(0.9 * number / max(len(curves) - 1, 1))
            axes.plot(middles, msr, color=colour, linewidth=1)
        axes.axhline(PAPER_MSR, color="C1", linestyle=":")
        axes.set_title(f"{title}, runs: {len(curves)}", fontsize=9)
        axes.set_xlabel("picks (millions)")
    panels[0, 0].set(ylabel="MSR while training", ylim=(0, 1.02))
    panels[0, 0].yaxis.set_major_formatter(PercentFormatter(1))
    return figure


@styled
def ends_by_window(table: pd.DataFrame) -> Figure:
    """MSR at the end of each run, by the window that is called its end.

    Args:
        table: one row per run, indexed by its group and seed, and one column per window.
    """
    figure, axes = plt.subplots(figsize=(6.4, 1 + 0.22 * len(table)))
    rows = np.arange(len(table))
    axes.hlines(rows, table.min(axis=1), table.max(axis=1), color="0.75", zorder=1)
    for number, window in enumerate(table):
        axes.plot(table[window], rows, MARKERS[number], color=f"C{number}", label=window,
                  markersize=5, alpha=0.85)  # fmt: skip
    _paper(axes)
    axes.set_yticks(rows, [f"{group}, seed {seed}" for group, seed in table.index], fontsize=7)
    axes.set(xlim=(0, 1.02), ylim=(len(table) - 0.5, -0.5), xlabel="MSR while training")
    axes.xaxis.set_major_formatter(PercentFormatter(1))
    axes.grid(False, axis="y")
    figure.legend(loc="outside upper center", ncols=len(table.columns))
    return figure


@styled
def means_of_few(means: Mapping[int, np.ndarray], wrong: pd.DataFrame) -> Figure:
    """What studies of few runs find: their means, and how often they are wrong.

    Args:
        means: number of runs → the means that studies of so many runs find.
        wrong: one row per number of runs, one column per wrong conclusion, its share.
    """
    figure, (left, right) = plt.subplots(1, 2, figsize=(8.4, 3.4))
    bins = np.linspace(0, 1, 41)
    for row, found in enumerate(means.values()):
        shares, _ = np.histogram(found, bins)
        height = 0.8 * shares / shares.max()
        left.bar(bins[:-1], height, np.diff(bins), row - 0.4, align="edge", color="C0")
    _paper(left)
    left.set_yticks(range(len(means)), means)
    left.set(xlim=(0, 1), xlabel="mean MSR that a study finds", ylabel="runs of the study")
    left.xaxis.set_major_formatter(PercentFormatter(1))
    left.grid(False, axis="y")
    _shares(right, wrong, "runs of each configuration")
    right.set(ylabel="share of studies", ylim=(0, 1.02))
    right.set_xscale("log", base=2)
    right.set_xticks(wrong.index, wrong.index)
    return figure


@styled
def coverage_by_runs(tables: Mapping[str, pd.DataFrame]) -> Figure:
    """How often 95 % intervals hold the true mean: a panel for each way that runs can end.

    Args:
        tables: title → the table of ``unload.reproduce.resampling.coverage``.
    """
    figure, panels = plt.subplots(
        1, len(tables), figsize=(4.2 * len(tables), 3.2), sharey=True, squeeze=False
    )
    for axes, (title, table) in zip(panels.flat, tables.items()):
        shares = table.pivot(index="runs", columns="interval", values="covered")
        _shares(axes, shares[table["interval"].unique()], "runs")
        axes.axhline(LEVEL, color="0.3", linestyle=":")
        axes.set_title(title, fontsize=9)
        axes.set_xscale("log", base=2)
        axes.set_xticks(shares.index, shares.index)
    panels[0, 0].set(ylabel="intervals that hold the true mean", ylim=(0, 1.02))
    return figure


@styled
def alarms_by_runs(table: pd.DataFrame, level: float = 0.05) -> Figure:
    """Share of studies that find a difference where there is none, with and without peeking.

    Args:
        table: of ``unload.reproduce.resampling.false_alarms``.
        level: that was asked for.
    """
    figure, axes = plt.subplots(figsize=(5, 3))
    names = {"planned": "one test, at this number", "peeking": "a test after each run up to it"}
    _shares(axes, table.set_index("runs")[list(names)].rename(columns=names), "runs of each group")
    axes.axhline(level, color="0.3", linestyle=":")
    axes.set(ylabel="false alarms", ylim=(0, None))
    return figure


def _paper(axes: Axes) -> None:
    """A dotted line at the paper's MSR."""
    axes.axvline(PAPER_MSR, color="0.3", linestyle=":", linewidth=1.2)
    axes.text(PAPER_MSR, 1.01, "paper", color="0.3", ha="center", va="bottom", fontsize=8,
              transform=axes.get_xaxis_transform())  # fmt: skip


def _shares(axes: Axes, shares: pd.DataFrame, label: str) -> None:
    """A line for each column of shares over the index."""
    for number, name in enumerate(shares):
        marker = MARKERS[number % len(MARKERS)]
        axes.plot(shares.index, shares[name], f"{marker}-", color=f"C{number}", label=name,
                  markersize=4)  # fmt: skip
    axes.set(xlabel=label)
    axes.yaxis.set_major_formatter(PercentFormatter(1, decimals=0))
    axes.minorticks_off()
    axes.legend(fontsize=8)
