"""The substacks of which loads are made (Fig. 3)."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from studies.style import styled
from unload.load.picture import package_colour
from unload.load.substacks import CELL, CELLS_WIDE, COLUMNS, LEFT, MID, PACKAGES, RIGHT, ROWS_HIGH

SUBSTACKS = {"left": LEFT, "mid": MID, "right": RIGHT}
INK = "#333333"


@styled
def fig03_substacks() -> Figure:
    """Fig. 3: the nine substacks, and how four of them interlock to a row of a wall.

    Numbers are packages 0–12; everything is drawn to the same scale.
    """
    figure, axes = plt.subplots(figsize=(8.2, 6.6))
    across, down, gap = 0.0, 0.88, 0.3  # m
    for name, variants in SUBSTACKS.items():
        boxes = np.concatenate(variants)
        width = (boxes[:, 1] + PACKAGES[boxes[:, 0], 0]).max() * CELL
        for variant, boxes in enumerate(variants):
            _draw_substack(axes, boxes, across, (3 - variant) * down)
        axes.text(across + width / 2, 4 * down - 0.1, name, ha="center", fontweight="bold")
        across += width + gap
    for variant in range(3):
        middle = (3 - variant) * down + ROWS_HIGH * CELL / 2
        axes.text(-0.08, middle, f"variant {variant}", ha="right", va="center")
    bar = across - gap + 0.14
    axes.plot([bar, bar], [down, down + 0.5], color=INK, lw=2, solid_capstyle="butt")
    axes.text(bar + 0.05, down + 0.25, "0.5 m", va="center")
    row = (0, 1, 2, 0)
    lift = -0.12
    for (column, variants), variant in zip(COLUMNS, row):
        _draw_substack(axes, variants[variant], column * CELL, lift)
    label = "left 0, mid 1, mid 2, right 0\nform one row of a wall,\n2.5 m wide, 0.69 m high"
    axes.text(CELLS_WIDE * CELL + 0.08, lift + ROWS_HIGH * CELL / 2, label, va="center")
    axes.set(xlim=(-0.48, CELLS_WIDE * CELL + 1.1), ylim=(lift - 0.02, 4 * down + 0.02))
    axes.set_aspect("equal")
    axes.axis("off")
    return figure


def _draw_substack(axes: Axes, boxes, x: float, z: float) -> None:
    """A substack whose own origin is at (x, z) in m, with its border."""
    for package, left, lower in boxes:
        width, height = PACKAGES[package] * CELL
        corner, colour = (x + left * CELL, z + lower * CELL), package_colour(package)
        axes.add_patch(Rectangle(corner, width, height, fc=colour, ec="white", lw=0.8))
        bright = np.dot(colour, (0.299, 0.587, 0.114)) > 0.55
        look = {"ha": "center", "va": "center_baseline", "color": INK if bright else "white"}
        middle = corner[0] + width / 2, corner[1] + height / 2
        axes.text(*middle, str(package), fontsize=8, **look)
    _draw_border(axes, boxes, x, z)


def _draw_border(axes: Axes, boxes, x: float, z: float) -> None:
    """Lines between cells of which one belongs to the substack and the other does not."""
    inside = np.zeros((COLUMNS[-1][0] + 2, ROWS_HIGH + 2), dtype=bool)
    for package, left, lower in boxes:
        width, height = PACKAGES[package]
        inside[left + 1 : left + width + 1, lower + 1 : lower + height + 1] = True
    style = {"color": INK, "lw": 1.8, "solid_capstyle": "projecting"}
    for column, row in np.argwhere(inside[1:] != inside[:-1]):
        across, up = x + column * CELL, z + row * CELL
        axes.plot([across, across], [up - CELL, up], **style)
    for column, row in np.argwhere(inside[:, 1:] != inside[:, :-1]):
        across, up = x + column * CELL, z + row * CELL
        axes.plot([across - CELL, across], [up, up], **style)
