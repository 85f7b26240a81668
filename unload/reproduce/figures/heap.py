"""Bulk picks from heaps: throughput against falls, and the physics against one another."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from unload.heap.rake import PHYSICS
from unload.heap.rules import RULES
from unload.reproduce.figures.style import mark_reduced, styled
from unload.reproduce.heap import NAME
from unload.reproduce.heap_table import REFERENCE
from unload.reproduce.results import COMMAND, read_table
from unload.support import files

COLOURS = {REFERENCE: "C1", "oracle": "0.4"}
AS_TRAINED = "as trained"


@styled
def throughput_falls(folder: str | Path = files.DATA) -> Figure:
    """Boxes and falls per pick on unseen heaps: a point for each rule, a curve over λ for others.

    Args:
        folder: of ``heap/table.csv``; the conditions other than the trained one are left out,
            and so are single networks of an average.

    Raises:
        FileNotFoundError: the table is missing; the message names the command.
    """
    columns = ["condition", "falls_weight", "policy", "boxes", "boxes_low", "boxes_high", "falls"]
    place = Path(folder) / NAME
    table = read_table(place / "table.csv", f"{COMMAND} heap-table", columns)
    table = table[(table["condition"] == AS_TRAINED) & ~table["policy"].str.contains(" seed ")]
    figure, axes = plt.subplots(figsize=(6.4, 4.2))
    for name, rows in table.groupby("policy", sort=False):
        rows = rows.sort_values("falls_weight")
        errors = np.abs(rows[["boxes_low", "boxes_high"]].to_numpy().T - rows["boxes"].to_numpy())
        if name in RULES:
            axes.errorbar(rows["falls"], rows["boxes"], errors, fmt="o", color="0.6", ms=4)
            axes.annotate(
                name,
                (rows["falls"].iloc[0], rows["boxes"].iloc[0]),
                xytext=(5, 3),
                textcoords="offset points",
                fontsize=8,
                color="0.4",
            )
        else:
            axes.errorbar(
                rows["falls"], rows["boxes"], errors, fmt="o-", ms=4, lw=1, label=name,
                color=COLOURS.get(name),
            )  # fmt: skip
    axes.set(xlabel="falls per pick", ylabel="boxes unloaded per pick", ylim=(0, None))
    axes.set_xlim(left=0)
    axes.legend(loc="lower right", fontsize=8)
    mark_reduced(figure, place, "table")
    return figure


@styled
def physics_agreement(folder: str | Path = files.DATA) -> Figure:
    """How far the dragged box came, and what was unloaded, in the quick physics and the whole.

    Args:
        folder: of ``heap/agreement.csv``.

    Raises:
        FileNotFoundError: the table is missing; the message names the command.
    """
    place = Path(folder) / NAME
    columns = ["pick", "physics", "unloaded", "falls", "came", "moved", "cpu_ms"]
    frame = read_table(place / "agreement.csv", f"{COMMAND} heap-agreement", columns)
    whole, *others = PHYSICS
    by = {name: rows.set_index("pick") for name, rows in frame.groupby("physics")}
    figure, grid = plt.subplots(1, len(others), figsize=(8, 3.8), sharex=True, sharey=True)
    for axes, name in zip(grid, others):
        counts = pd.crosstab(by[whole]["unloaded"], by[name]["unloaded"]).stack()
        x, y = (counts.index.get_level_values(level) for level in (0, 1))
        axes.scatter(x, y, s=12 * counts**0.7, color="C0", alpha=0.8)
        same = (by[whole]["unloaded"] == by[name]["unloaded"]).mean()
        axes.axline((0, 0), slope=1, color="#bbbbbb", lw=1, zorder=0)
        axes.set(
            xlabel=f"boxes unloaded, {whole}",
            ylabel=f"boxes unloaded, {name}",
            title=f"{name}: {same:.0%} the same, {by[name]['cpu_ms'].median():.0f} ms a pick",
        )
    return figure
