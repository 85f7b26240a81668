"""Figs. 11 and 12: the training in the container (Sec. IV-B), episodes, values and deadlocks."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import EngFormatter

from unload import task
from unload.load.boxes import Load
from unload.load.view import COLOURS
from unload.reproduce.paper.grids import PAPER
from unload.reproduce.paper.training import default_curves, episode_means
from unload.reproduce.style import mark_reduced, styled
from unload.support import files

SEED_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")  # told apart by the colour-blind, too


@styled
def fig11_loss(folder: str | Path = files.DATA) -> Figure:
    """Training loss over picks (Fig. 11), one line per seed; the first one is strong.

    Args:
        folder: of the curves that ``python -m unload.reproduce training`` writes.

    Raises:
        FileNotFoundError: there are none.
    """
    losses = {seed: curve["loss"] for seed, curve in default_curves(folder).items()}
    return _figure(losses, r"loss $\ell$", (0, 0.6), folder)


@styled
def fig12_reward(folder: str | Path = files.DATA) -> Figure:
    """Mean reward per pick of the 64 environments over picks (Fig. 12).

    Each point is a mean over an episode of all environments. Arguments, lines and errors as in
    ``fig11_loss``.
    """
    rewards = {
        seed: 2 * curve["success_rate"] - 1 for seed, curve in default_curves(folder).items()
    }
    return _figure(rewards, r"$r_\mathrm{mean}$", (-1, 1), folder)


def draw_learning_curve(axes: Axes, curve: pd.DataFrame, name: str, color: str = "C0") -> None:
    """Draw the MSR while training: pale at each point of the curve, strong over whole episodes.

    Args:
        axes: where.
        curve: of ``unload.train``, see ``episode_means``.
        name: in the legend.
        color: of both lines.
    """
    axes.plot(curve["picks"], curve["success_rate"], color=color, linewidth=0.7, alpha=0.45)
    episodes = episode_means(curve)
    middle = episodes["picks"] - task.NUM_ENVS * task.MAX_PICKS / 2
    axes.plot(middle, episodes["success_rate"], "o-", color=color, markersize=3.5, label=name)
    axes.set(xlabel="picks", ylabel="MSR while training", ylim=(0, 1.02), xlim=(0, None))
    axes.xaxis.set_major_formatter(EngFormatter(sep=" "))


def draw_by_pick(axes: Axes, curves: dict[str, np.ndarray]) -> None:
    """Draw the MSR over the picks of an episode, means over 20 picks.

    Args:
        axes: where.
        curves: (500,) each by name, see ``msr_by_pick``.
    """
    for name, msr in curves.items():
        means = msr.reshape(-1, 20).mean(axis=1)
        axes.plot(np.arange(10, len(msr), 20), means, label=name)
    axes.set(xlabel="pick of the episode", ylabel="MSR", ylim=(0, 1.02), xlim=(0, task.MAX_PICKS))


def draw_values(axes: Axes, heights: np.ndarray, values: np.ndarray, liftable: np.ndarray) -> None:
    """Draw the action values of the visible items over their heights.

    Args:
        axes: where.
        heights: (items,) scaled to the container.
        values: (items,) of the network.
        liftable: (items,) bool, what can be lifted.
    """
    for name, rows in (("blocked", ~liftable), ("liftable", liftable)):
        axes.scatter(heights[rows], values[rows], s=10, color=COLOURS[name], label=name)
    axes.set(xlabel=r"height $\tilde p_z$", ylabel="action value", ylim=(-1.1, 1.1))


def draw_picks(axes: Axes, items: np.ndarray, unloaded: np.ndarray) -> None:
    """Draw each pick of an episode as a dot at its item.

    Args:
        axes: where.
        items: (picks,) int, the item of each pick.
        unloaded: (picks,) bool, whether the pick succeeded.
    """
    picks = np.arange(len(items))
    for name, rows, colour in (("failed", ~unloaded, "failed"), ("unloaded", unloaded, "liftable")):
        axes.scatter(picks[rows], items[rows], s=6, color=COLOURS[colour], label=name)
    axes.set(xlabel="pick of the episode", ylabel="item")


def draw_stuck(axes: Axes, load: Load, present: np.ndarray, item: int, above: np.ndarray) -> None:
    """Draw the wall of an item that is stuck, as seen from the entrance.

    Args:
        axes: where.
        load: of the container.
        present: (items,) bool, the items that have not been unloaded.
        item: the number of the item.
        above: numbers of the items that rest on it.
    """
    wall = np.flatnonzero((load.walls == load.walls[item]) & present)
    kinds = {
        f"item {item}, which is blocked": (COLOURS["blocked"], wall == item),
        "on top of it": (COLOURS["on top of it"], np.isin(wall, above)),
        "other items of the wall": (COLOURS["unseen"], (wall != item) & ~np.isin(wall, above)),
    }
    for name, (colour, chosen) in kinds.items():
        for number in wall[chosen]:
            corner = load.positions[number, 1:] - load.sizes[number, 1:] / 2
            box = Rectangle(corner, *load.sizes[number, 1:], facecolor=colour, edgecolor="white")
            axes.add_patch(box).set_label(name)
            name = None  # the legend needs it once
    axes.set(
        xlim=(0, task.CONTAINER[1]), ylim=(0, task.CONTAINER[2]), xlabel="y (m)", ylabel="z (m)"
    )
    axes.set_aspect("equal")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), fontsize=8)


def _figure(
    curves: dict[int, pd.Series], label: str, limits: tuple[float, float], folder: str | Path
) -> Figure:
    figure, axes = plt.subplots()
    for number, (seed, values) in enumerate(curves.items()):
        style = {"linewidth": 0.8, "alpha": 0.8} if number else {"zorder": 3}
        axes.plot(values, color=SEED_COLOURS[number], label=f"seed {seed}", **style)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=4)
    end = max(values.index[-1] for values in curves.values())
    axes.set(xlabel="step $k$ (picks)", ylabel=label, ylim=limits, xlim=(0, end))
    axes.xaxis.set_major_formatter(EngFormatter(sep=" "))
    mark_reduced(figure, folder, PAPER.name)
    return figure
