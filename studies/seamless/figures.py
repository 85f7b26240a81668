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

Panels = Mapping[str, Mapping[str, str]]


@styled
def fig11_loss(curves: pd.DataFrame, panels: Panels) -> Figure:
    """Training loss over picks (Fig. 11), a panel for each setting.

    Thin lines are means over episodes of all containers, strong ones running means of the first
    seed over half a million picks.

    Args:
        curves: of ``read_grid``.
        panels: the cells of each by a key of ``MASK_LINES``, by its title.
    """
    figure, all_axes = _panels(curves.assign(value=curves["loss"]), panels)
    all_axes[0].set(ylabel=r"loss $\ell$", ylim=(0, 0.6))
    return figure


@styled
def fig12_reward(curves: pd.DataFrame, panels: Panels) -> Figure:
    """Mean reward of the 64 environments over picks (Fig. 12), a panel for each setting.

    The marks are the paper's: −0.7 at the start, 0.2 at the end. Arguments as of ``fig11_loss``.
    """
    figure, all_axes = _panels(curves.assign(value=2 * curves["success_rate"] - 1), panels)
    for axes in all_axes:
        for place, reward in ((0.0, 2 * PAPER_START - 1), (2e7, 2 * PAPER_MSR - 1)):
            axes.axhline(reward, color="0.4", linestyle=":", linewidth=1)
            axes.plot(place, reward, "k*", markersize=11, clip_on=False, zorder=4)
    all_axes[-1].annotate(
        "the paper: steady …", (3e6, -0.58), (4.2e6, -0.85), fontsize=8, color="0.25"
    )
    all_axes[-1].annotate("… then slower and noisier", (10.2e6, -0.2), fontsize=8, color="0.25")
    all_axes[0].set(ylabel=r"$r_\mathrm{mean}$", ylim=(-1, 1))
    return figure


def _panels(curves: pd.DataFrame, panels: Panels) -> tuple[Figure, np.ndarray]:
    """A panel for each setting, with the ``value`` of every run's curve."""
    figure, (all_axes,) = plt.subplots(
        1, len(panels), figsize=(3 + 2.6 * len(panels), 3.6), sharex=True, sharey=True,
        squeeze=False,
    )  # fmt: skip
    for axes, (title, cells) in zip(all_axes, panels.items()):
        for (name, cell), colour in zip(cells.items(), ("C1", "C0")):
            for number, (_, run) in enumerate(curves[curves["cell"] == cell].groupby("seed")):
                axes.plot(run["picks"], run["value"], colour, linewidth=0.4, alpha=0.35)
                if number == 0:
                    smooth = run["value"].rolling(SMOOTH, min_periods=1).mean()
                    look = {"linestyle": MASK_LINES[name], "linewidth": 1.8, "zorder": 3}
                    axes.plot(run["picks"], smooth, colour, label=name, **look)
        axes.set(title=title, xlabel="step $k$ (picks)", xlim=(0, 2e7), xticks=np.arange(5) * 5e6)
        axes.xaxis.set_major_formatter(EngFormatter(sep=" "))
    figure.get_layout_engine().set(wspace=0.06)  # the last tick of a panel, the first of the next
    handles, labels = all_axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=2)
    return figure, all_axes


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


@styled
def draw_jams(table: pd.DataFrame, wanted: tuple[float, float]) -> Figure:
    """Share of the free boxes that jam over the friction of the contact, a line for each gap.

    Args:
        table: rows of ``jams.csv`` of fresh loads, with ``friction``, ``gap``, ``load``, ``free``
            and ``jammed``.
        wanted: the shares between which the paper's start and end lie; shaded.
    """
    figure, axes = plt.subplots(figsize=(5.2, 3.4))
    axes.axhspan(100 * wanted[0], 100 * wanted[1], color="0.9", label="j of the model")
    colours = plt.get_cmap("viridis")(np.linspace(0, 0.85, table["gap"].nunique()))
    for (gap, rows), colour in zip(table.groupby("gap"), colours):
        groups = rows.groupby("friction")[["free", "jammed"]].sum()
        share = 100 * groups["jammed"] / groups["free"]
        name = "seamless" if gap == 0 else f"gap {1000 * gap:g} mm"
        axes.plot(share.index, share, "o-", color=colour, label=name)
        by_load = 100 * rows["jammed"] / rows["free"]
        axes.plot(rows["friction"], by_load, ".", color=colour, alpha=0.4, markersize=4)
    axes.set(xlabel="friction of a contact", ylabel="free boxes that jam (%)", ylim=(-2, 102))
    axes.legend(fontsize=8)
    return figure
