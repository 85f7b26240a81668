"""What came out, in one figure: the README's."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies.grid import Grid, read_grid
from studies.order.training import ORDER
from studies.paper.training import PAPER, SMOOTH
from studies.results import read_table
from studies.style import styled
from studies.ties.figures import draw_words

BATCH_COLOURS = {2048: "#1d4e79", 256: "#e08214"}
# The panels of learning curves: title, grid, and the cell of each batch.
TRAINED: dict[str, tuple[Grid, dict[int, str]]] = {
    "1  Algorithm 1 to the letter:\n    the index, mask on": (
        ORDER, {2048: "index_b2048_mask", 256: "index_mask"},
    ),
    "2  Ranks, trained\n    without the mask": (
        PAPER, {2048: "paper_b2048_no_mask", 256: "paper_no_mask"},
    ),
    "3  Ranks, trained\n    with the mask": (
        PAPER, {2048: "paper_b2048_mask", 256: "paper_mask"},
    ),
}  # fmt: skip
# How the same agents choose afterwards, and the marker.
ASKED = {
    "with the mask": ({"mask": True, "place": True}, "o", "full"),
    "without the mask": ({"mask": False, "place": True}, "o", "none"),
    "with the mask, by height alone": ({"mask": True, "place": False}, "^", "full"),
}


@styled
def draw_answer() -> Figure:
    """Learning curves by what agents see and how they are trained, and the agents afterwards.

    Strong lines are means over the runs of a batch, thin ones running means of single runs over
    half a million picks; the last panel has a marker per agent.
    """
    widths = {"width_ratios": [1, 1, 1, 1.35]}
    figure, panels = plt.subplots(1, 4, figsize=(12.4, 3.9), sharey=True, gridspec_kw=widths)
    for axes, (title, (grid, cells)) in zip(panels, TRAINED.items()):
        for batch, cell in cells.items():
            runs = _draw_runs(axes, read_grid(grid, [cell]), BATCH_COLOURS[batch])
            label = f"batch {batch} ({runs} {'agent' if runs == 1 else 'agents'})"
            axes.plot([], [], c=BATCH_COLOURS[batch], lw=2.2, label=label)
        axes.set_title(title, loc="left")
        axes.set(xlim=(0, 20), xticks=range(0, 21, 5), xlabel="million picks of training")
    draw_words(panels[0], lambda msr: 100 * msr, picks=20, label="the paper")
    for axes in panels[:3]:
        axes.legend(loc="lower right", fontsize=8)
    panels[0].set(ylim=(0, 103), ylabel="successful picks (%)")
    _draw_choices(panels[3])
    return figure


def _draw_runs(axes: Axes, curves: pd.DataFrame, colour: str) -> int:
    """Draw runs, pale below their mean, and return how many they are."""
    smooth = [
        pd.Series(100 * run["success_rate"].rolling(SMOOTH, min_periods=1).mean().to_numpy(),
                  run["picks"] / 1e6)
        for _, run in curves.groupby("seed")
    ]  # fmt: skip
    for run in smooth:
        axes.plot(run, color=colour, linewidth=0.7, alpha=0.35)
    axes.plot(pd.concat(smooth, axis=1).mean(axis=1), color=colour, linewidth=2.2)
    return len(smooth)


def _draw_choices(axes: Axes) -> None:
    """A marker per agent in new containers, by how it was trained and by how it chooses."""
    index = read_table("order/choice").assign(place=True)
    choices = pd.concat([index, read_table("ties/choice")])
    frozen, names = choices[choices["noise"] == "frozen"], []
    for panel, (_, cells) in enumerate(TRAINED.values(), 1):
        middle = len(names) + (len(cells) - 1) / 2
        axes.text(middle, 104, str(panel), ha="center", va="bottom", fontsize=9)
        for batch, cell in cells.items():
            rows, column = frozen[frozen["cell"] == cell], len(names)
            for shift, (label, (way, marker, fill)) in zip((-0.27, 0, 0.27), ASKED.items()):
                chosen = rows[(rows[list(way)] == pd.Series(way)).all(axis=1)]
                # Side by side within their place, so that equal ones can be counted.
                places = column + shift + np.linspace(-0.09, 0.09, len(chosen))
                look = {"ms": 3.5, "fillstyle": fill, "c": BATCH_COLOURS[batch], "clip_on": False}
                if len(chosen):  # the index was not asked by height alone
                    axes.plot(places, 100 * chosen["msr"], marker, **look)
                if not names:
                    axes.plot([], [], marker, ms=4, fillstyle=fill, c="0.3", label=label)
            names.append(str(batch))
    axes.set_xticks(range(len(names)), names, fontsize=8)
    axes.set(xlabel="panel and batch", xlim=(-0.5, len(names) - 0.5))
    axes.set_title("4  The same agents\n    in new containers", loc="left", pad=14)
    axes.grid(axis="x", visible=False)
    axes.legend(loc="upper left", bbox_to_anchor=(0, 0.62), fontsize=8)
