"""Bulk picks from heaps: policies compared, the camera, and the physics against one another."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from unload.heap.rake import PHYSICS
from unload.heap.rules import RULES
from unload.reproduce.figures.style import mark_reduced, styled
from unload.reproduce.heap import NAME
from unload.reproduce.heap_learning import SHOWN_WEIGHT, VARIANTS
from unload.reproduce.heap_lifts import success_rates
from unload.reproduce.heap_table import (
    AS_TRAINED,
    BY_PROBABILITY,
    FEW,
    LEARNED,
    LINEAR,
    MEASURES,
    REFERENCE,
    SEED,
    VARIED,
    VARIED_RULE,
)
from unload.reproduce.results import COMMAND, read_table
from unload.support import files

COLOURS = {
    REFERENCE: "C1", LEARNED: "C0", LINEAR: "C4", VARIED: "C2", "oracle": "0.2", "random": "C5",
    BY_PROBABILITY: "C0", VARIED_RULE: "C3",
}  # fmt: skip
# Where the names of rules stand that lie close together: offset in points, and alignment.
NAME_PLACES = {
    "clear above": ((-2, 9), "center"), "nearest": ((0, -13), "center"),
    "highest": ((5, -12), "left"), "random": ((5, -12), "left"),
}  # fmt: skip
KEY = "condition", "falls_weight", "policy", "heaps", "base"
ENDS = "", "_low", "_high"
COLUMNS = [
    *KEY,
    *(name + end for name in (*MEASURES, "net_more", "net_to_base") for end in ENDS),
]
UNITS = {
    "boxes": "boxes a pick", "falls": "falls a pick", "net": "boxes − λ falls a pick",
    "net_to_base": "difference to its base", "success": "share of lifts that succeed",
}  # fmt: skip


def read_heap_table(folder: str | Path = files.DATA) -> pd.DataFrame:
    """``heap/table.csv``, see ``unload.reproduce.heap_table.compared``.

    Raises:
        FileNotFoundError: it is missing; the message names the command.
    """
    return read_table(Path(folder) / NAME / "table.csv", f"{COMMAND} heap-table", COLUMNS)


def at_shown_weight(
    table: pd.DataFrame, policies: Sequence[str], condition: str = AS_TRAINED
) -> pd.DataFrame:
    """Rows of a table at the λ that it shows, by policy, as far as they are there."""
    rows = table[(table["condition"] == condition) & (table["falls_weight"] == SHOWN_WEIGHT)]
    rows = rows.set_index("policy")
    return rows.loc[[name for name in policies if name in rows.index]]


def _dots(axes: Axes, rows: pd.DataFrame, measure: str) -> None:
    """A dot with its interval for each policy, the first one on top."""
    places = np.arange(len(rows))[::-1]
    for place, (name, row) in zip(places, rows.iterrows()):
        is_learned = name in VARIANTS or str(name).startswith(SEED)
        low, value, high = row[f"{measure}_low"], row[measure], row[f"{measure}_high"]
        colour = COLOURS.get(name, COLOURS[LEARNED] if is_learned else "0.55")
        axes.plot([low, high], [place, place], color=colour, lw=2)
        axes.plot(value, place, "o", color=colour, ms=5)
    axes.set(yticks=places, yticklabels=list(rows.index), xlabel=UNITS[measure])


@styled
def policies(folder: str | Path = files.DATA) -> Figure:
    """Boxes, falls and their balance for each policy as trained, with 95 % intervals.

    Args:
        folder: of ``heap/table.csv``.

    Raises:
        FileNotFoundError: the table is missing; the message names the command.
    """
    rows = at_shown_weight(
        read_heap_table(folder), [*RULES, REFERENCE, VARIED_RULE, LINEAR, LEARNED, VARIED, "oracle"]
    )
    figure, grid = plt.subplots(1, len(MEASURES), figsize=(9, 3.4), sharey=True)
    for axes, measure in zip(grid, MEASURES):
        _dots(axes, rows, measure)
    mark_reduced(figure, Path(folder) / NAME, "table")
    return figure


@styled
def ablations(folder: str | Path = files.DATA) -> Figure:
    """Balance of the variants of the learned policy, and of each seed alone.

    Right: the difference to the policy from which each differs in one thing.

    Args:
        folder: of ``heap/table.csv``.

    Raises:
        FileNotFoundError: the table is missing; the message names the command.
    """
    table = read_heap_table(folder)
    names = table["policy"].unique()
    seeds = sorted(name for name in names if name.startswith(SEED))
    rows = at_shown_weight(table, [*VARIANTS, BY_PROBABILITY, *seeds])
    figure, grid = plt.subplots(1, 2, figsize=(9, 3.8))
    _dots(grid[0], rows, "net")
    compared = rows.drop(index=LEARNED)
    pairs = [f"{name} − {base}" for name, base in compared["base"].items()]
    _dots(grid[1], compared.set_axis(pairs), "net_to_base")
    grid[1].axvline(0, color="0.6", lw=1, zorder=0)
    mark_reduced(figure, Path(folder) / NAME, "table")
    return figure


@styled
def conditions(folder: str | Path = files.DATA) -> Figure:
    """Balance of few policies under each condition, with 95 % intervals.

    Args:
        folder: of ``heap/table.csv``.

    Raises:
        FileNotFoundError: the table is missing; the message names the command.
    """
    table = read_heap_table(folder)
    names = list(dict.fromkeys(table["condition"]))
    figure, axes = plt.subplots(figsize=(7, 0.55 * len(names) + 1.4))
    shown = [name for name in FEW if name in set(table["policy"])]
    for number, name in enumerate(shown):
        shift = 0.14 * ((len(shown) - 1) / 2 - number)
        for place, condition in enumerate(reversed(names)):
            for _, row in at_shown_weight(table, [name], condition).iterrows():
                y, colour = place + shift, COLOURS[name]
                axes.plot([row["net_low"], row["net_high"]], [y, y], color=colour, lw=1.6)
                label = name if not place else None
                axes.plot(row["net"], y, "o", color=colour, ms=4.5, label=label)
    axes.set(yticks=range(len(names)), yticklabels=names[::-1], xlabel=UNITS["net"])
    axes.legend(loc="center left", bbox_to_anchor=(1, 0.5), fontsize=8)
    mark_reduced(figure, Path(folder) / NAME, "table")
    return figure


def leads(folder: str | Path = files.DATA) -> pd.DataFrame:
    """How far the learned policy is ahead of both rules under each condition, as text.

    Args:
        folder: of ``heap/table.csv``.

    Returns:
        One row per condition: its boxes - falls a pick, and those that it has more than each
        rule on the same heaps, with the 95 % interval.

    Raises:
        FileNotFoundError: the table is missing; the message names the command.
    """
    table, rows = read_heap_table(folder), {}
    for condition in dict.fromkeys(table["condition"]):
        of = at_shown_weight(table, [LEARNED, VARIED_RULE], condition)
        more = of.loc[LEARNED, ["net_more", "net_more_low", "net_more_high"]]
        rows[condition] = {
            "boxes − falls": f"{of.loc[LEARNED, 'net']:.2f}",
            f"more than the {REFERENCE}": _with_interval(*more),
        }
        if VARIED_RULE in of.index:  # its base is the learned policy, so that the signs turn
            less = of.loc[VARIED_RULE, ["net_to_base", "net_to_base_high", "net_to_base_low"]]
            rows[condition][f"more than the {VARIED_RULE}"] = _with_interval(*-less)
    return pd.DataFrame(rows).T


def _with_interval(value: float, low: float, high: float) -> str:
    return f"{value:+.2f} ({low:+.2f} to {high:+.2f})"


@styled
def throughput_falls(folder: str | Path = files.DATA) -> Figure:
    """Boxes and falls per pick on unseen heaps: a point for each rule, a curve over λ for others.

    Args:
        folder: of ``heap/table.csv``; the conditions other than the trained one are left out,
            and so are single seeds and all variants of the learned policy but the linear one.

    Raises:
        FileNotFoundError: the table is missing; the message names the command.
    """
    table = read_heap_table(folder)
    shown = [*RULES, REFERENCE, VARIED_RULE, LINEAR, LEARNED, VARIED, "oracle"]
    table = table[(table["condition"] == AS_TRAINED) & table["policy"].isin(shown)]
    figure, axes = plt.subplots(figsize=(6.4, 4.2))
    for name, rows in table.groupby("policy", sort=False):
        rows = rows.sort_values("falls_weight")
        colour = "0.6" if name in RULES else COLOURS[name]
        label = None if name in RULES else name
        x, y = (
            np.abs(rows[[f"{part}_low", f"{part}_high"]].to_numpy().T - rows[part].to_numpy())
            for part in ("falls", "boxes")
        )
        axes.errorbar(rows["falls"], rows["boxes"], y, x, "o", color=colour, ms=4, lw=0.8)
        axes.plot(rows["falls"], rows["boxes"], "o-", color=colour, ms=4, lw=1.6, label=label)
        marks = [(name, rows.iloc[0])]
        if name not in RULES:
            marks = [(f"λ = {row['falls_weight']:g}", row) for _, row in rows.iterrows()]
        for text, row in marks if name in (*RULES, LEARNED) else []:
            usual = ((5, 4), "left") if name in RULES else ((-4, 5), "right")
            place, side = NAME_PLACES.get(text, usual)
            axes.annotate(
                text, (row["falls"], row["boxes"]), xytext=place, textcoords="offset points",
                ha=side, fontsize=8, color="0.4" if name in RULES else colour,
            )  # fmt: skip
    axes.set(xlabel=UNITS["falls"], ylabel=UNITS["boxes"])
    axes.set_xlim(left=0)
    axes.legend(loc="lower right", fontsize=8)
    mark_reduced(figure, Path(folder) / NAME, "table")
    return figure


@styled
def lifts_and_picks(folder: str | Path = files.DATA) -> Figure:
    """What rules reach with single lifts, and the same rules with the rake.

    Args:
        folder: of ``heap/lifts.csv`` and ``heap/table.csv``.

    Raises:
        FileNotFoundError: a table is missing; the message names the command.
    """
    place = Path(folder) / NAME
    lifts = read_table(
        place / "lifts.csv",
        f"{COMMAND} heap-lifts",
        ["policy", "heap", "lifts", "success_rate", "falls"],
    )
    rates = success_rates(lifts).sort_values("success", ascending=False, kind="stable")
    order = list(rates.index)
    figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3), sharey=True)
    _dots(left, rates, "success")
    left.set(xlim=(0, 1.02))
    _dots(right, at_shown_weight(read_heap_table(folder), order), "net")
    left.set_title("single lifts")
    right.set_title("bulk picks")
    for data in ("lifts", "table"):
        mark_reduced(figure, place, data)
    return figure


@styled
def predictions(expected: pd.DataFrame, found: pd.DataFrame) -> Figure:
    """What a network expects of each box of a heap, and what dragging it has brought.

    Args:
        expected: one row per box, with ``boxes`` and ``falls``.
        found: the same for the picks that were made.
    """
    figure, grid = plt.subplots(1, 2, figsize=(7, 3.2))
    for axes, measure in zip(grid, ("boxes", "falls")):
        axes.scatter(expected[measure], found[measure], s=22, alpha=0.7, color="C0", lw=0)
        axes.axline((0, 0), slope=1, color="0.7", lw=1, zorder=0)
        axes.set(xlabel=f"{measure}, expected", ylabel=f"{measure}, after the pick")
    return figure


@styled
def camera_errors(folder: str | Path = files.DATA) -> Figure:
    """How far off the camera's boxes are, by how much of a box shows.

    Args:
        folder: of ``heap/camera.csv``.

    Raises:
        FileNotFoundError: the table is missing; the message names the command.
    """
    place = Path(folder) / NAME
    columns = ["pixels", "centre_error", "extent_error"]
    frame = read_table(place / "camera.csv", f"{COMMAND} heap-camera", columns)
    figure, grid = plt.subplots(1, 2, figsize=(7, 2.8), sharex=True)
    named = {"centre_error": "error of the centre (m)", "extent_error": "error of the extents (m)"}
    for axes, (column, label) in zip(grid, named.items()):
        axes.scatter(frame["pixels"], frame[column], s=3, alpha=0.35, color="C0", lw=0)
        parts = frame.groupby(pd.qcut(frame["pixels"], 8, duplicates="drop"), observed=True)
        middle = parts[["pixels", column]].median()
        axes.plot(middle["pixels"], middle[column], "o-", color="C1", label="median")
        axes.set(xscale="log", xlabel="pixels that show the box", ylabel=label)
    grid[0].legend()
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
