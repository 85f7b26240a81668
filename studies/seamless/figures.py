"""Figs. 11 and 12 with a gap of 1 mm and in seamless walls, and where runs start and end."""

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

from studies.statistics import PAPER_MSR
from studies.style import styled

PAPER_START = 0.15  # MSR at the start of its Fig. 12
CHANCE = 0.26  # MSR of random picks with a gap of 1 mm
MASK_LINES = {"with the mask": "-", "without the mask": "--"}  # as everywhere: dashed is without
SMOOTH = 16  # episodes of all containers, about half a million picks


@styled
def over_picks(
    curves: pd.DataFrame, column: str, panels: Mapping[str, Mapping[str, str]]
) -> Figure:
    """A measure of all runs over picks, a panel for each setting (Figs. 11 and 12).

    Thin lines are means over episodes of all containers, strong ones running means of the first
    seed over half a million picks.

    Args:
        curves: ``cell``, ``seed``, ``picks`` and the measure.
        column: which measure.
        panels: the cells of each by a key of ``MASK_LINES``, by its title.
    """
    figure, (all_axes,) = plt.subplots(
        1, len(panels), figsize=(3 + 2.6 * len(panels), 3.6), sharex=True, sharey=True,
        squeeze=False,
    )  # fmt: skip
    for axes, (title, cells) in zip(all_axes, panels.items()):
        for (name, cell), colour in zip(cells.items(), ("C1", "C0")):
            for number, (_, run) in enumerate(curves[curves["cell"] == cell].groupby("seed")):
                axes.plot(run["picks"], run[column], colour, linewidth=0.4, alpha=0.35)
                if number == 0:
                    smooth = run[column].rolling(SMOOTH, min_periods=1).mean()
                    look = {"linestyle": MASK_LINES[name], "linewidth": 1.8, "zorder": 3}
                    axes.plot(run["picks"], smooth, colour, label=name, **look)
        axes.set(title=title, xlabel="step $k$ (picks)", xlim=(0, 2e7), xticks=np.arange(5) * 5e6)
        axes.xaxis.set_major_formatter(EngFormatter(sep=" "))
    figure.get_layout_engine().set(wspace=0.06)  # the last tick of a panel, the first of the next
    handles, labels = all_axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=2)
    return figure


@styled
def draw_start_and_end(groups: Mapping[str, tuple[pd.DataFrame, dict]]) -> Figure:
    """Where runs start and end, the paper's point, and what a share of jammed boxes allows.

    Args:
        groups: rows of ``statistics.by_run`` and the look of their dots, by their names.
    """
    figure, axes = plt.subplots(figsize=(5.6, 4.2))
    shares = np.linspace(0, 0.8, 81)
    axes.plot(
        100 * CHANCE * (1 - shares), 100 * (1 - shares), "0.6", label="0.26 (1 − j) and 1 − j"
    )
    for share in (0, 0.2, 0.4, 0.6):
        axes.annotate(
            f"j = {share:g}", (100 * CHANCE * (1 - share), 100 * (1 - share)), (-38, 2),
            textcoords="offset points", fontsize=8, color="0.4",
        )  # fmt: skip
    for name, (rows, look) in groups.items():
        axes.plot(
            100 * rows["start"], 100 * rows["end"], label=name, linestyle="", alpha=0.7, **look
        )
    axes.plot(100 * PAPER_START, 100 * PAPER_MSR, "k*", markersize=15, label="the paper")
    axes.set(
        xlabel="MSR over the first episode (%)", ylabel="MSR over the last tenth of the picks (%)",
        xlim=(0, 32), ylim=(0, 102),
    )  # fmt: skip
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
    return figure
