"""What came out, in one figure: the README's."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies.grid import read_grid
from studies.paper.training import PAPER, SMOOTH
from studies.results import read_table
from studies.statistics import PAPER_MSR, PAPER_START
from studies.style import COLOURS, WITHOUT_MASK, styled

# How a line is drawn by the batch, here and in the legend.
BATCHES = {2048: "-", 256: (0, (4, 1.5))}
# The cells of the paper's configuration by whether the mask is on in training, and by batch.
TRAINED = {
    "no mask": {2048: "paper_b2048_no_mask", 256: "paper_no_mask"},
    "mask": {2048: "paper_b2048_mask", 256: "paper_mask"},
}
TRAINING_COLOURS = {"no mask": WITHOUT_MASK, "mask": COLOURS["ranks"]}
# How the same agents choose afterwards: the rows of ``ties/choice.csv``, and the marker.
ASKED = {
    "without the mask": ({"mask": False, "place": True}, "o", "none"),
    "with the mask": ({"mask": True, "place": True}, "o", "full"),
    "by height alone": ({"mask": True, "place": False}, "^", "full"),
}


@styled
def draw_answer() -> Figure:
    """Learning curves by how agents are trained, and the same agents in new containers.

    Strong lines are means over the runs of a batch, thin ones running means of single runs over
    half a million picks; the last panel has a marker per agent.
    """
    curves, choices = read_grid(PAPER), read_table("ties/choice")
    widths = {"width_ratios": [1, 1, 1, 1.25]}
    figure, panels = plt.subplots(1, 4, figsize=(12.4, 3.9), sharey=True, gridspec_kw=widths)
    for axes, (name, title) in zip(
        panels,
        {
            "no mask": "1  Trained as in the paper,\n    without the mask",
            "mask": "2  Trained with the mask:\n    up, then down",
        }.items(),
    ):
        colour = TRAINING_COLOURS[name]
        for batch, cell in TRAINED[name].items():
            runs = _draw_runs(axes, curves, cell, colour, BATCHES[batch])
            label = f"batch {batch} ({runs} agents)"
            axes.plot([], [], c=colour, ls=BATCHES[batch], lw=2.2, label=label)
        stars = {"ms": 11, "zorder": 5, "label": "the paper", "clip_on": False}
        axes.plot([0, 20], [100 * PAPER_START, 100 * PAPER_MSR], "k*", **stars)
        axes.set_title(title, loc="left")
        axes.legend(loc="lower right", fontsize=8)
    positions = [_draw_runs(panels[2], curves, f"positions_{mask}", COLOURS["positions"], "-")
                 for mask in ("mask", "no_mask")]  # fmt: skip
    panels[2].plot(
        [], [], c=COLOURS["positions"], lw=2.2, label=f"batch 256 ({sum(positions)} agents)"
    )
    panels[2].set_title("3  Positions\n    instead of ranks", loc="left")
    panels[2].legend(loc="lower right", fontsize=8)
    for axes in panels[:3]:
        axes.set(xlim=(0, 20), xticks=range(0, 21, 5), xlabel="million picks of training")
    panels[0].set(ylim=(0, 103), ylabel="successful picks (%)")
    _draw_choices(panels[3], choices)
    look = {"ncols": 3, "fontsize": 8, "title_fontsize": 8, "handletextpad": 0.2}
    title = "how the agents of panel 4 choose"
    handles = panels[3].get_legend_handles_labels()
    figure.legend(*handles, loc="outside lower right", title=title, **look)
    return figure


def _draw_runs(axes: Axes, curves: pd.DataFrame, cell: str, colour: str, line) -> int:
    """Draw all runs of a cell, pale below their mean, and return how many they are."""
    smooth = [
        pd.Series(100 * run["success_rate"].rolling(SMOOTH, min_periods=1).mean().to_numpy(),
                  run["picks"] / 1e6)
        for _, run in curves[curves["cell"] == cell].groupby("seed")
    ]  # fmt: skip
    for run in smooth:
        axes.plot(run, color=colour, linewidth=0.7, alpha=0.35)
    axes.plot(pd.concat(smooth, axis=1).mean(axis=1), color=colour, linestyle=line, linewidth=2.2)
    return len(smooth)


def _draw_choices(axes: Axes, choices: pd.DataFrame) -> None:
    """A marker per agent in new containers, by how it was trained and by how it chooses."""
    frozen = choices[choices["noise"] == "frozen"]
    names, column = [], 0
    for name, cells in TRAINED.items():
        for batch, cell in cells.items():
            rows = frozen[frozen["cell"] == cell]
            for shift, (label, (way, marker, fill)) in zip((-0.27, 0, 0.27), ASKED.items()):
                chosen = rows[(rows[list(way)] == pd.Series(way)).all(axis=1)]
                # Side by side within their place, so that equal ones can be counted.
                places = column + shift + np.linspace(-0.09, 0.09, len(chosen))
                look = {"ms": 3.5, "fillstyle": fill, "c": _dark(name), "clip_on": False}
                label = label if column == 0 else None
                axes.plot(places, 100 * chosen["msr"], marker, **look, label=label)
            names.append(f"{name}\n{batch}")
            column += 1
    axes.set_xticks(range(column), names)
    axes.set(xlabel="how they were trained, and the batch", xlim=(-0.5, column - 0.5))
    axes.set_title("4  The same agents afterwards,\n    in new containers", loc="left")
    axes.grid(axis="x", visible=False)


def _dark(name: str) -> str:
    """The colour of a training in the last panel, where pale markers would be lost."""
    return "0.35" if name == "no mask" else TRAINING_COLOURS[name]
