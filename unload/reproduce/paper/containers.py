"""Containers: many side by side (Fig. 2), one from the side, and its walls from the entrance."""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from unload import task
from unload.load.boxes import Load
from unload.load.substacks import package_colour
from unload.load.view import COLOURS
from unload.reproduce.style import styled
from unload.support import checks


@styled
def fig02_containers(
    images: Sequence[np.ndarray], unloaded: Sequence[int] | None = None, columns: int = 8
) -> Figure:
    """Fig. 2: pictures of the containers of a vector environment in a grid.

    Args:
        images: of equal shape (height, width, 3) uint8, as ``render`` of a vector
            environment returns them, in the order in which they are drawn.
        unloaded: items unloaded from each container, written below its picture.
        columns: pictures in a line.

    """
    images = _crop(np.stack(images))
    lines = -(-len(images) // columns)
    _, height, width, _ = images.shape
    cell = 8 / columns  # inches
    figure, grid = plt.subplots(
        lines,
        columns,
        figsize=(8, lines * (cell * height / width + (0.0 if unloaded is None else 0.12))),
        squeeze=False,
    )
    for axes in grid.flat:
        axes.axis("off")
    for number, (axes, image) in enumerate(zip(grid.flat, images)):
        axes.imshow(image, interpolation="antialiased")
        if unloaded is not None:
            axes.text(0.5, 0.0, unloaded[number], transform=axes.transAxes, ha="center",
                      va="top", fontsize=6, color="#555555")  # fmt: skip
    return figure


def _crop(images: np.ndarray) -> np.ndarray:
    """Cut away the margin that is white in all pictures."""
    drawn = (images < 255).any(axis=(0, 3))
    rows, columns = np.flatnonzero(drawn.any(axis=1)), np.flatnonzero(drawn.any(axis=0))
    if not len(rows):
        return images
    return images[:, rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]


@styled
def side_views(positions: np.ndarray, views: Mapping[str, Mapping[str, np.ndarray]]) -> Figure:
    """Centres of items seen from the side, one picture above the other, to scale.

    Args:
        positions: (n, 3) float, centres in m.
        views: title → groups; these are meaning → item numbers, see ``unload.load.COLOURS``.
            Of two groups that share an item the later one is drawn.

    Raises:
        ValueError: a group's name is not in ``unload.load.COLOURS``.
    """
    length, _, height = task.CONTAINER
    figure, panels = plt.subplots(
        len(views), 1, figsize=(7, 2.3 * len(views) + 0.6), sharex=True, squeeze=False
    )
    for axes, (title, groups) in zip(panels[:, 0], views.items()):
        draw_items(axes, positions[:, [0, 2]], groups)
        axes.set(xlim=(0, length), ylim=(0, height), ylabel="z (m)", title=title, aspect="equal")
    panels[-1, 0].set_xlabel("x (m), entrance on the right")
    _legend(figure, *panels[0, 0].get_legend_handles_labels())
    return figure


def draw_items(axes: Axes, points: np.ndarray, groups: Mapping[str, np.ndarray], **style) -> None:
    """Draw items as dots in the colours of their groups' meanings, which label them.

    Args:
        axes: where to draw.
        points: (n, 2) float, where the items are on ``axes``.
        groups: meaning → item numbers.
        **style: of the dots, such as ``ms``.

    Raises:
        ValueError: a group's name is not in ``unload.load.COLOURS``.
    """
    for meaning, items in groups.items():
        checks.one_of("a group's name", meaning, COLOURS)
        look = {"ms": 4, "mew": 0.3, "mec": "0.55", "color": COLOURS[meaning]} | style
        axes.plot(*points[np.asarray(items, dtype=int)].T, "o", label=meaning, **look)


@styled
def wall_views(
    load: Load,
    walls: Sequence[int],
    groups: Mapping[str, np.ndarray] | None = None,
    present: np.ndarray | None = None,
) -> Figure:
    """Walls of a load, each as it is seen from the entrance, to scale.

    Args:
        load: the boxes.
        walls: numbers of the walls, in the order in which they are drawn.
        groups: meaning → item numbers, as in ``side_views``; items in no group are "unseen".
            If None, colours mean packages.
        present: (n,) bool, which boxes to draw; all if None.

    Raises:
        ValueError: a group's name is not in ``unload.load.COLOURS``.
    """
    colours = [package_colour(package) for package in load.packages]
    if groups is not None:
        groups = {"unseen": np.arange(len(load)), **groups}
        for meaning, items in groups.items():
            checks.one_of("a group's name", meaning, COLOURS)
            for item in items:
                colours[item] = COLOURS[meaning]
    _, width, height = task.CONTAINER
    figure, panels = plt.subplots(
        1, len(walls), figsize=(1 + 2.3 * max(len(walls), 1.6), 3.6), sharey=True, squeeze=False
    )
    for axes, wall in zip(panels[0], walls):
        in_wall = load.walls == wall if present is None else (load.walls == wall) & present
        for item in np.flatnonzero(in_wall):
            corner = load.positions[item] - load.sizes[item] / 2
            axes.add_patch(
                Rectangle(corner[1:], *load.sizes[item, 1:], fc=colours[item], ec="white", lw=0.8)
            )
        axes.set(xlim=(0, width), ylim=(0, height), xlabel="y (m)", aspect="equal")
        axes.set(title=f"wall {wall}", xticks=[0, 1, 2], yticks=[0, 1, 2])
        axes.grid(False)
    panels[0, 0].set_ylabel("z (m)")
    if groups is not None:
        _legend(figure, [Patch(fc=COLOURS[meaning]) for meaning in groups], list(groups))
    return figure


def _legend(figure: Figure, handles: list, labels: list[str]) -> None:
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
