"""Why 60 %: what the controlled experiments show."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter, PercentFormatter

from unload.reproduce.figures.style import mark_reduced, styled
from unload.reproduce.intervals import bootstrap_interval, with_intervals
from unload.reproduce.results import COMMAND, read_table
from unload.reproduce.study import FEATURE_SETTINGS, read_study
from unload.support import checks, files
from unload.support.provenance import read_provenance

CELL = ["features", "mask", "epsilon_final"]
APPLIED = {"msr_mask": ("C0", "o", "told what failed"), "msr_no_mask": ("C1", "s", "not told")}
PAPER_MSR = 0.6  # at the end of its Fig. 12
OFFLINE = ["features", "seed", "loss", "msr_mask", "msr_no_mask", "deadlocked"]
# Why 60 %: what is changed, in which cell of the factorial study, and the bar's colour.
CHANGES = {
    "nothing": (("noisy ranks", False), "C1"),
    "mask in training": (("noisy ranks", True), "C3"),
    "equal coordinates share one rank": (("tied ranks", False), "C2"),
    "positions instead of ranks": (("positions", False), "C0"),
}


@styled
def why_60(folder: str | Path = files.DATA) -> Figure:
    """MSR at the end of training: as reported, of the same configuration, and one change away.

    The measure is the paper's (Fig. 12): all containers of the training, over its last part.
    Bars are means over the seeds, the dots; lines are 95 % intervals.

    Args:
        folder: of ``training_summary.csv`` and ``study/factorial.csv``.

    Raises:
        FileNotFoundError: a table is missing; the message says how to compute it.
    """
    path = Path(folder) / "training_summary.csv"
    training = read_table(path, f"{COMMAND} training", ["msr_start", "msr_end"])
    rows, _ = read_study("factorial", folder)
    cells = rows[rows["epsilon_final"] == 0].groupby(["features", "mask"])["msr_training"]
    count = EngFormatter(sep=" ")
    long, short = read_provenance(folder, "training")["settings"]["picks"], rows["picks"].max()
    bars = {
        "the paper reports": ([PAPER_MSR], "0.6"),
        f"its training here, {count(long)} picks": (training["msr_end"], "C1"),
        **{name: (cells.get_group(cell), colour) for name, (cell, colour) in CHANGES.items()},
    }
    places = [0, 1, 2.8, 3.8, 4.8, 5.8]  # room for a heading above the changes
    figure, axes = plt.subplots(figsize=(6.4, 3.2))
    for place, (values, colour) in zip(places, bars.values()):
        mean = np.mean(values)
        axes.barh(place, mean, color=colour, height=0.72)
        if len(values) > 1:
            axes.plot(bootstrap_interval(values), [place, place], color="black", linewidth=1)
            axes.plot(values, [place] * len(values), "o", color="black", markersize=2.5, alpha=0.6)
        axes.text(max(values) + 0.02, place, f"{mean:.0%}", va="center", fontsize=11)
    start = training["msr_start"].mean()
    axes.axvline(start, color="0.4", linestyle=":", linewidth=1)
    axes.text(start, -0.55, "random picks", ha="center", va="bottom", color="0.4", fontsize=8)
    axes.text(-0.02, 2.05, f"{count(short)} picks, one thing changed:", ha="right", va="center",
              color="0.4", transform=axes.get_yaxis_transform())  # fmt: skip
    axes.set_yticks(places, bars)
    axes.set(ylim=(6.4, -0.6), xlim=(0, 1.1), xticks=np.linspace(0, 1, 6))
    axes.set_xlabel("mean success rate (MSR) at the end of training")
    axes.xaxis.set_major_formatter(PercentFormatter(1))
    axes.grid(False, axis="y")
    axes.tick_params(axis="y", length=0)
    mark_reduced(figure, folder, "training")
    return figure


@styled
def offline_msr(folder: str | Path = files.DATA) -> Figure:
    """MSR of networks fitted to the same random picks, by what they see of the positions.

    Args:
        folder: of ``study/offline.csv``.

    Raises:
        FileNotFoundError: it is missing; the message says how to compute it.
        ValueError: it has other columns.
    """
    rows = read_table(Path(folder) / "study" / "offline.csv", f"{COMMAND} offline", OFFLINE)
    cells = dict(list(rows.groupby("features", sort=False)))
    return _one_panel(list(cells), list(cells.values()))


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
        len(FEATURE_SETTINGS), 1, figsize=(6.4, 5.2), sharex=True, sharey=True
    )
    for axes, features in zip(panels, FEATURE_SETTINGS):
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
    experiment: str | Sequence[str], field: str | Sequence[str], folder: str | Path = files.DATA
) -> Figure:
    """MSR of the policies of an experiment that varies one setting at a time.

    Args:
        experiment: a name in ``unload.reproduce.study.EXPERIMENTS``, or several to be shown as one.
        field: the settings that are varied; a row is named by those that differ from the
            first row's.
        folder: of the data.

    Raises:
        ValueError: a field is not a column.
        FileNotFoundError: see ``read_study``.
    """
    experiments = [experiment] if isinstance(experiment, str) else experiment
    rows = pd.concat([read_study(name, folder)[0] for name in experiments])
    fields = [field] if isinstance(field, str) else list(field)
    checks.entries("the experiment", dict(rows), fields)
    cells = list(rows.groupby(fields, sort=False))
    first = cells[0][0]
    names = []
    for key, _ in cells:
        changed = [
            f"{name} {value}"
            for name, value, base in zip(fields, key, first)
            if value != base or len(fields) == 1
        ]
        names.append(", ".join(changed).replace("_", " ") or "unchanged")
    return _one_panel(names, [cell for _, cell in cells])


@styled
def factorial_curves(folder: str | Path = files.DATA) -> Figure:
    """MSR of each cell's policy without the mask over the picks of the training.

    Mean over the seeds and 95 % interval; the exploring agent itself is not shown.

    Args:
        folder: of ``study/factorial_curves.csv``.

    Raises:
        FileNotFoundError: see ``read_study``.
    """
    _, curves = read_study("factorial", folder)
    figure, panels = plt.subplots(1, len(FEATURE_SETTINGS), figsize=(7.6, 2.8), sharey=True)
    for axes, features in zip(panels, FEATURE_SETTINGS):
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


def _one_panel(names: Sequence[str], cells: Sequence[pd.DataFrame]) -> Figure:
    figure, axes = plt.subplots(figsize=(6.4, 0.8 + 0.34 * len(cells)))
    _dots(axes, names, cells)
    axes.set(xlabel="MSR of the trained policy on fresh loads", xlim=(0, 1.02))
    axes.xaxis.set_major_formatter(PercentFormatter(1))
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=2)
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
