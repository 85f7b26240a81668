"""Pictures of a deadlock: the picks of an episode, and the item that is picked for ever."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from unload.load.boxes import Load
from unload.load.colours import COLOURS
from unload.task import CONTAINER


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
    axes.set(xlim=(0, CONTAINER[1]), ylim=(0, CONTAINER[2]), xlabel="y (m)", ylabel="z (m)")
    axes.set_aspect("equal")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), fontsize=8)
