"""Figures of heaps: what a pick does, and the policies compared."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from studies import paths
from studies.heap.picture import MEANINGS, draw_heap  # noqa: F401 - the notebook draws by it
from studies.heap.policies import RULES
from studies.heap.rake import Outcome
from studies.heap.table import LEARNED, ORACLE, REFERENCE, read_heap_table
from studies.style import COLOURS as RULE_COLOURS
from studies.style import styled

LINES = {REFERENCE: RULE_COLOURS["highest"], LEARNED: "C0", ORACLE: "0.2"}
# Where the names of rules stand that lie close together: offset in points, and alignment.
NAME_PLACES = {
    "clear above": ((-2, 9), "center"), "nearest": ((0, -13), "center"),
    "highest": ((5, -12), "left"), "random": ((5, -12), "left"),
}  # fmt: skip
UNITS = {"boxes": "boxes a pick", "falls": "falls a pick", "net": "boxes − λ falls a pick"}


def outcome_colours(outcome: Outcome, box: int) -> np.ndarray:
    """(n, 3) float, the colour in ``MEANINGS`` of what a pick does to each box before it."""
    stays, comes, falls, dragged = MEANINGS.values()
    colours = np.tile(stays, (len(outcome.unloaded), 1))
    colours[outcome.unloaded] = comes
    colours[outcome.fallen] = falls
    colours[box] = dragged
    return colours


def add_legend(figure: Figure) -> None:
    handles = [Patch(facecolor=c, edgecolor="0.5", label=name) for name, c in MEANINGS.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(MEANINGS), frameon=False)


@styled
def throughput_falls(folder: str | Path = paths.DATA) -> Figure:
    """Boxes and falls a pick on unseen heaps: a point for each rule, a curve over λ for others."""
    figure, axes = plt.subplots(figsize=(6.4, 4.2))
    for name, rows in read_heap_table(folder).groupby("policy", sort=False):
        rows = rows.sort_values("falls_weight")
        colour = LINES.get(name, "0.6")
        x, y = (
            np.abs(rows[[f"{part}_low", f"{part}_high"]].to_numpy().T - rows[part].to_numpy())
            for part in ("falls", "boxes")
        )
        axes.errorbar(rows["falls"], rows["boxes"], y, x, "o", color=colour, ms=4, lw=0.8)
        label = name if name in LINES else None
        axes.plot(rows["falls"], rows["boxes"], "o-", color=colour, ms=4, lw=1.6, label=label)
        marks = {}
        if name in RULES:
            marks = {name: rows.iloc[0]}
        elif name == LEARNED:
            marks = {f"λ = {row['falls_weight']:g}": row for _, row in rows.iterrows()}
        for text, row in marks.items():
            usual = ((5, 4), "left") if name in RULES else ((-4, 5), "right")
            place, side = NAME_PLACES.get(text, usual)
            axes.annotate(
                text, (row["falls"], row["boxes"]), xytext=place, textcoords="offset points",
                ha=side, fontsize=8, color="0.4" if name in RULES else colour,
            )  # fmt: skip
    axes.set(xlabel=UNITS["falls"], ylabel=UNITS["boxes"])
    axes.set_xlim(left=0)
    axes.legend(loc="lower right", fontsize=8)
    return figure
