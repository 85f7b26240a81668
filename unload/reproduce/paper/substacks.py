"""Packages, substacks and rows of a wall, drawn to scale (Fig. 3)."""

from collections.abc import Iterable, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from unload.load.substacks import (
    CELL,
    CELLS_WIDE,
    COLUMNS,
    LEFT,
    MID,
    PACKAGES,
    RIGHT,
    ROWS_HIGH,
    check_variants,
    package_colour,
)
from unload.reproduce.style import styled

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
        width = max(_right_end(boxes) for boxes in variants)
        for variant, boxes in enumerate(variants):
            _draw_substack(axes, boxes, across, (3 - variant) * down)
        axes.text(across + width / 2, 4 * down - 0.1, name, ha="center", fontweight="bold")
        across += width + gap
    for variant in range(3):
        middle = (3 - variant) * down + ROWS_HIGH * CELL / 2
        axes.text(-0.08, middle, f"variant {variant}", ha="right", va="center")
    _scale_bar(axes, across - gap + 0.14, down)
    row = (0, 1, 2, 0)
    lift = -0.12
    for (column, variants), variant in zip(COLUMNS, row):
        _draw_substack(axes, variants[variant], column * CELL, lift)
    label = "left 0, mid 1, mid 2, right 0\nform one row of a wall,\n2.5 m wide, 0.69 m high"
    axes.text(CELLS_WIDE * CELL + 0.08, lift + ROWS_HIGH * CELL / 2, label, va="center")
    _bare(axes, (-0.48, CELLS_WIDE * CELL + 1.1), (lift - 0.02, 4 * down + 0.02))
    return figure


@styled
def packages() -> Figure:
    """The 13 packages side by side, with width and height in cm."""
    figure, axes = plt.subplots(figsize=(8.6, 1.9))
    left = 0.0
    for package, (width, height) in enumerate(PACKAGES * CELL):
        # Narrow boxes get enough room for their label.
        room = max(width, 0.36)
        start = left + (room - width) / 2
        _draw_box(axes, package, start, 0.0, width, height)
        label = f"{100 * width:.0f} × {100 * height:.0f}"
        axes.text(left + room / 2, -0.04, label, ha="center", va="top", fontsize=8)
        left += room + 0.06
    _bare(axes, (0, left), (-0.14, 0.46))
    axes.set_title("packages 0–12, width × height in cm", loc="left")
    return figure


@styled
def rows(combinations: Iterable[Sequence[int]]) -> Figure:
    """Rows of a wall one above the other, two in a line.

    Args:
        combinations: for each row the variants (0–2) of its left, two mid and right
            substacks.

    Raises:
        TypeError, ValueError: see ``check_variants``.
    """
    combinations = check_variants("combinations", list(combinations))
    lines = -(-len(combinations) // 2)
    figure, grid = plt.subplots(lines, 2, figsize=(8.6, 1.6 * lines), squeeze=False)
    for axes in grid.flat[len(combinations) :]:
        axes.remove()
    for axes, variants in zip(grid.flat, combinations):
        draw_row(axes, variants)
        axes.set_title("variants " + " ".join(str(variant) for variant in variants), fontsize=9)
    return figure


def draw_row(axes: Axes, variants: Sequence[int]) -> None:
    """Draw one row of a wall, its substacks outlined.

    Args:
        axes: where to draw; both axes are in m.
        variants: (4,) int, variant 0–2 of the left, the two mid and the right substack.

    Raises:
        TypeError, ValueError: see ``check_variants``.
    """
    (variants,) = check_variants("variants", [variants])
    for (column, substacks), variant in zip(COLUMNS, variants):
        _draw_substack(axes, substacks[variant], column * CELL, 0.0, fontsize=7)
    width, height = CELLS_WIDE * CELL, ROWS_HIGH * CELL
    _bare(axes, (-0.03, width + 0.03), (-0.03, height + 0.03))


def _draw_substack(axes: Axes, boxes, x: float, z: float, fontsize: int = 8) -> None:
    """A substack whose own origin is at (x, z) in m, with its border."""
    for package, left, lower in boxes:
        width, height = PACKAGES[package] * CELL
        _draw_box(axes, package, x + left * CELL, z + lower * CELL, width, height, fontsize)
    _draw_border(axes, boxes, x, z)


def _right_end(boxes: Sequence[tuple[int, int, int]]) -> float:
    return max(left + PACKAGES[package][0] for package, left, _ in boxes) * CELL


def _draw_box(axes, package, left, lower, width, height, fontsize=8) -> None:
    colour = package_colour(package)
    axes.add_patch(Rectangle((left, lower), width, height, fc=colour, ec="white", lw=0.8))
    bright = np.dot(colour, (0.299, 0.587, 0.114)) > 0.55
    axes.text(
        left + width / 2,
        lower + height / 2,
        str(package),
        ha="center",
        va="center_baseline",
        fontsize=fontsize,
        color=INK if bright else "white",
    )


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


def _scale_bar(axes: Axes, x: float, z: float, length: float = 0.5) -> None:
    axes.plot([x, x], [z, z + length], color=INK, lw=2, solid_capstyle="butt")
    axes.text(x + 0.05, z + length / 2, f"{length} m", va="center")


def _bare(axes: Axes, xlim: tuple[float, float], zlim: tuple[float, float]) -> None:
    axes.set(xlim=xlim, ylim=zlim, aspect="equal")
    axes.axis("off")
