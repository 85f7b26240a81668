"""Why 60 %: what the controlled experiments show."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter, PercentFormatter

from unload import checks, files
from unload.figures.style import styled
from unload.intervals import bootstrap_interval, with_intervals
from unload.judge import read_study
from unload.study import FEATURES

CELL = ["features", "mask", "epsilon_final"]
APPLIED = {"msr_mask": ("C0", "o", "told what failed"), "msr_no_mask": ("C3", "s", "not told")}
PAPER_MSR = 0.6


def factorial_table(folder: str | Path = files.DATA) -> pd.DataFrame:
    """The cells of the factorial study with means and intervals over the seeds.

    Returns:
        One row per cell: ``features``, ``mask``, ``epsilon_final``, ``runs``; for
        ``msr_mask``, ``msr_no_mask``, ``deadlocked``, ``msr_training`` and
        ``deadlocked_overall`` the mean, ``_low`` and ``_high``; ``longest_deadlock`` of any
        run; ``reached``, how many runs come to 99 % without the mask, and ``picks_to_goal``,
        the median of those that do.

    Raises:
        FileNotFoundError: see ``read_study``.
    """
    rows, _ = read_study("factorial", folder)
    measures = ["msr_mask", "msr_no_mask", "deadlocked", "msr_training", "deadlocked_overall"]
    table = with_intervals(rows, CELL, measures)
    groups = rows.groupby(CELL, sort=False)
    table["longest_deadlock"] = groups["longest_deadlock"].max().to_numpy()
    table["reached"] = groups["picks_to_goal_no_mask"].count().to_numpy()
    table["picks_to_goal"] = groups["picks_to_goal_no_mask"].median().to_numpy()
    return table


@styled
def factorial_msr(folder: str | Path = files.DATA) -> Figure:
    """MSR of each cell's trained policies: mean, 95 % interval, and every seed.

    Args:
        folder: of ``study/factorial.csv``.

    Raises:
        FileNotFoundError: see ``read_study``.
    """
    rows, _ = read_study("factorial", folder)
    figure, panels = plt.subplots(
        len(FEATURES), 1, figsize=(6.4, 5.2), sharex=True, sharey=True, layout="constrained"
    )
    for axes, features in zip(panels, FEATURES):
        group = rows[rows["features"] == features]
        cells = list(group.groupby(["mask", "epsilon_final"], sort=False))
        names = [
            f"{'mask' if mask else 'no mask'}, {floor:.0%} random" for (mask, floor), _ in cells
        ]
        _dots(axes, names, [cell for _, cell in cells])
        axes.set_title(f"network sees {features}", loc="left", fontsize=10)
        axes.axvline(PAPER_MSR, color="0.6", linestyle=":", zorder=0)
    panels[0].text(PAPER_MSR, 1.02, "paper", transform=panels[0].get_xaxis_transform(),
                   ha="center", va="bottom", color="0.4", fontsize=8)  # fmt: skip
    panels[-1].set(xlabel="MSR of the trained policy on fresh loads", xlim=(0, 1.02))
    panels[-1].xaxis.set_major_formatter(PercentFormatter(1))
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=2, title="at application")
    return figure


@styled
def varied_msr(
    experiment: str, field: str | Sequence[str], folder: str | Path = files.DATA
) -> Figure:
    """MSR of the policies of an experiment that varies one setting at a time.

    Args:
        experiment: a name in ``unload.study.EXPERIMENTS``.
        field: the settings that are varied; a row is named by those that differ from the
            first row's.
        folder: of the data.

    Raises:
        ValueError: a field is not a column.
        FileNotFoundError: see ``read_study``.
    """
    rows, _ = read_study(experiment, folder)
    fields = [field] if isinstance(field, str) else list(field)
    checks.entries("the experiment", dict(rows), fields)
    cells = list(rows.groupby(fields, sort=False))
    first = cells[0][0]
    names = []
    for number, (key, _) in enumerate(cells):
        changed = [
            f"{name} {value}"
            for name, value, base in zip(fields, key, first)
            if value != base or len(fields) == 1
        ]
        names.append(", ".join(changed).replace("_", " ") if changed or number else "as it was")
    figure, axes = plt.subplots(figsize=(6.4, 0.8 + 0.34 * len(cells)), layout="constrained")
    _dots(axes, names, [cell for _, cell in cells])
    axes.set(xlabel="MSR of the trained policy on fresh loads", xlim=(0, 1.02))
    axes.xaxis.set_major_formatter(PercentFormatter(1))
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=2)
    return figure


@styled
def factorial_curves(folder: str | Path = files.DATA) -> Figure:
    """What each cell's policy achieves, not told what failed, as training goes on.

    Mean over the seeds and 95 % interval; the exploring agent itself is not shown.

    Args:
        folder: of ``study/factorial_curves.csv``.

    Raises:
        FileNotFoundError: see ``read_study``.
    """
    _, curves = read_study("factorial", folder)
    figure, panels = plt.subplots(1, len(FEATURES), figsize=(7.6, 2.8), sharey=True)
    for axes, features in zip(panels, FEATURES):
        group = curves[curves["features"] == features]
        for (mask, floor), cell in group.groupby(["mask", "epsilon_final"], sort=False):
            label = f"{'mask' if mask else 'no mask'}, {floor:.0%} random"
            _band(axes, cell, "msr_no_mask", f"C{int(mask)}", "--" if floor else "-", label)
        axes.set(title=features, xlabel="picks", ylim=(0, 1.02))
        axes.xaxis.set_major_formatter(EngFormatter(sep=" "))
    panels[0].set_ylabel("greedy MSR, not told")
    panels[0].yaxis.set_major_formatter(PercentFormatter(1))
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=4)
    return figure


def _dots(axes: Axes, names: Sequence[str], cells: Sequence[pd.DataFrame]) -> None:
    """A line for each cell: its seeds pale, their mean strong, with its interval."""
    for row, cell in enumerate(cells):
        for place, (name, (colour, marker, label)) in enumerate(APPLIED.items()):
            y = row + (0.15 if place else -0.15)
            axes.plot(cell[name], np.full(len(cell), y), marker, color=colour, alpha=0.3,
                      markersize=3, linestyle="none")  # fmt: skip
            low, high = bootstrap_interval(cell[name].to_numpy())
            axes.plot([low, high], [y, y], color=colour, linewidth=1.2)
            axes.plot(cell[name].mean(), y, marker, color=colour, markersize=6,
                      linestyle="none", label=None if row else label)  # fmt: skip
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.5)


def _band(axes: Axes, cell: pd.DataFrame, name: str, colour: str, line: str, label: str) -> None:
    """Mean and interval over the seeds at each number of picks."""
    points = with_intervals(cell, ["picks"], [name])
    axes.plot(points["picks"], points[name], color=colour, linestyle=line, label=label)
    axes.fill_between(points["picks"], points[f"{name}_low"], points[f"{name}_high"],
                      color=colour, alpha=0.2, linewidth=0)  # fmt: skip
