"""The paper's figures that no data are drawn in.

The task as a Markov decision process (Fig. 1), containers side by side (2), substacks (3), and the
network (7). Notebooks 01, 03 and 10 draw and save them.
"""

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch, Rectangle

from studies.style import styled
from unload import ContainerEnv, task
from unload.drawing.picture import package_colour, snapshot
from unload.load.substacks import (
    CELL,
    CELLS_HIGH,
    CELLS_WIDE,
    COLUMNS,
    LEFT,
    MID,
    PACKAGES,
    RIGHT,
)

INK = "#333333"
PANELS = {"Agent": (19, "#eaf2f8"), "Environment": (1, "#f6f1e7")}  # lower edge, colour
WIDTH, HEIGHT = 17, 6.5  # of a block of Fig. 1
LEFT_EDGES = (13.5, 33.5, 53.5, 73.5)  # left edges of the blocks
# From left to right: what a block is called, and what it does.
AGENT = (
    ("equalization", "ranks, Alg. 1"),
    ("PEQ network", "one score per item"),
    ("action mask", "failed items are out"),
    ("choice", "ε-greedy"),
)
ENVIRONMENT = (
    ("observation", "128 nearest, scaled"),
    ("container", "800–1000 items"),
    ("moved ≥ 0.2 m?", "yes: unload, no: leave"),
    ("lift", "PyBullet: 20 N, 0.3 s"),
)
SUBSTACKS = {"left": LEFT, "mid": MID, "right": RIGHT}
DRAWN, FEATURES = 7, 6  # of Fig. 7: items and features that are drawn, of 128 and n
TOP, CELL_HEIGHT = 6.2, 0.36  # of the tensors
MIDDLE = TOP - DRAWN * CELL_HEIGHT / 2  # height of the main line of arrows
BLUE, GREEN, RED, OCHRE, PURPLE = "#2878b5", "#45a661", "#de5638", "#c98a1b", "#9467bd"


@styled
def fig01_mdp() -> Figure:
    """Fig. 1: agent and environment of the task, and what passes between them."""
    figure, axes = plt.subplots(figsize=(9.2, 3.3))
    axes.set(xlim=(0, 104), ylim=(0, 37), aspect="equal")
    axes.axis("off")
    for name, (low, colour) in PANELS.items():
        _rounded(axes, 12, low, 80, 17, fc=colour, ec="none")
        axes.text(13.5, low + 15.8, name, fontsize=12, fontweight="bold", va="top")
    upper, lower = 25.5, 3  # lower edges of the blocks
    for blocks, low in ((AGENT, upper), (ENVIRONMENT, lower)):
        for x, (title, text) in zip(LEFT_EDGES, blocks):
            _rounded(axes, x, low, WIDTH, HEIGHT, fc="white", ec=INK, lw=1)
            style = {"ha": "center", "va": "center"}
            axes.text(x + WIDTH / 2, low + 4.2, title, fontweight="bold", fontsize=9, **style)
            axes.text(x + WIDTH / 2, low + 1.9, text, fontsize=8, color="#555555", **style)
    middle, below = upper + HEIGHT / 2, lower + HEIGHT / 2
    for left, right in zip(LEFT_EDGES, LEFT_EDGES[1:]):
        _path(axes, [(left + WIDTH, middle), (right, middle)])
        _path(axes, [(right, below), (left + WIDTH, below)])
    axes.text(52, middle + 0.5, r"$\hat{q}$", ha="center", va="bottom", color=INK)
    _rounded(axes, 19, 20.2, 34, 3, fc="white", ec=INK)
    text = r"learning: replay buffer, smooth-$L_1$ loss ($\gamma = 0$)"
    axes.text(36, 21.7, text, ha="center", va="center", fontsize=8)
    _path(axes, [(42, 23.2), (42, upper)], (0, (3, 2)))

    # Action on the right, observation on the left, reward and mask between the panels.
    _path(axes, [(90.5, middle), (98, middle), (98, below), (90.5, below)])
    axes.text(99, 17.5, "action\n$u_k$: row of\nthe item\nto pick", va="center")
    _path(axes, [(13.5, below), (6, below), (6, middle), (13.5, middle)])
    axes.text(5, 17.5, "next\nobservation\n$x_{k+1}$", va="center", ha="right")
    _path(axes, [(58, lower + HEIGHT), (58, 21.7), (53, 21.7)])
    axes.text(57, 14, r"reward $r_{k+1} = \pm 1$", va="center", ha="right")
    _path(axes, [(66, lower + HEIGHT), (66, upper)])
    axes.text(67, 14, "mask of failed items", va="center")
    return figure


@styled
def fig02_containers(containers: Sequence[ContainerEnv]) -> Figure:
    """Containers as they are, one of them large; below each how many boxes have left it."""
    pictured = [(each.load, each.present, each.load.positions) for each in containers]
    images = np.stack([snapshot(*each) for each in pictured])
    drawn = (images < 255).any(axis=(0, 3))  # beyond, all are white
    rows, columns = np.flatnonzero(drawn.any(axis=1)), np.flatnonzero(drawn.any(axis=0))
    images = images[:, rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]

    large = len(images) // 2
    small = [number for number in range(len(images)) if number != large]
    figure = plt.figure(figsize=(9.6, 5.2))
    left, right = figure.subfigures(1, 2, width_ratios=(1, 1.1))
    across = max(2, round(0.9 * len(small) ** 0.5))
    grid = right.subplots(-(-len(small) // across), across, squeeze=False)
    places = {left.subplots(): large} | dict(zip(grid.flat, small))
    for axes, number in places.items():
        axes.imshow(images[number], interpolation="antialiased")
        gone = (~containers[number].present).sum()
        axes.set_xlabel(gone, fontsize=12 if number == large else 8, labelpad=0)
    for axes in (*places, *grid.flat):
        axes.set(xticks=[], yticks=[], frame_on=False)
    return figure


@styled
def fig03_substacks() -> Figure:
    """Fig. 3: the nine substacks that ``build_load`` places, and how four interlock to a row.

    Numbers are packages 0–12; everything is drawn to the same scale.
    """
    figure, axes = plt.subplots(figsize=(8.2, 6.6))
    across, pitch, gap = 0.0, 0.88, 0.3  # m; the pitch from one variant to the next
    for name, variants in SUBSTACKS.items():
        package, left, _ = np.concatenate(variants).T
        width = (left + PACKAGES[package, 0]).max() * CELL
        for variant, boxes in enumerate(variants):
            _draw_substack(axes, boxes, across, (3 - variant) * pitch)
        axes.text(across + width / 2, 4 * pitch - 0.1, name, ha="center", fontweight="bold")
        across += width + gap
    for variant in range(3):
        middle = (3 - variant) * pitch + CELLS_HIGH * CELL / 2
        axes.text(-0.08, middle, f"variant {variant}", ha="right", va="center")
    bar = across - gap + 0.14
    axes.plot([bar, bar], [pitch, pitch + 0.5], color=INK, lw=2, solid_capstyle="butt")
    axes.text(bar + 0.05, pitch + 0.25, "0.5 m", va="center")
    # One row of a wall: a variant in each column.
    low = -0.12
    for (left, variants), number in zip(COLUMNS, (0, 1, 2, 0)):
        _draw_substack(axes, variants[number], left * CELL, low)
    label = "left 0, mid 1, mid 2, right 0\nform one row of a wall,\n2.5 m wide, 0.69 m high"
    axes.text(CELLS_WIDE * CELL + 0.08, low + CELLS_HIGH * CELL / 2, label, va="center")
    axes.set(xlim=(-0.48, CELLS_WIDE * CELL + 1.1), ylim=(low - 0.02, 4 * pitch + 0.02))
    axes.set_aspect("equal")
    axes.axis("off")
    return figure


@styled
def fig07_network(n_features: int) -> Figure:
    """Fig. 7: observations → features → features beside their pooled values → action values.

    The cells are shaded by a forward pass of a small network of this kind, so that the
    pooled blocks are seen to be the same for every item.

    Args:
        n_features: n, for the parameter counts below the drawing.
    """
    n = n_features
    observed, features, pooled, values = _forward_pass()
    figure, axes = plt.subplots(figsize=(11, 4.2))
    axes.set(xlim=(0, 22), ylim=(-0.7, 7.6), aspect="equal")
    axes.axis("off")

    items = task.N_VISIBLE
    _tensor(axes, 0.4, observed, 0.4, BLUE)
    _label(axes, 1.0, r"observations $x$", f"[{items}, 3]")
    _operation(axes, 2.4, MIDDLE, "learnable\nfeature\nextractor\n$f_1$")
    _tensor(axes, 5.8, features, 0.36, BLUE)
    _label(axes, 6.88, r"learned features $x_{\mathrm{LF}}$", f"[{items}, n]")
    own_left, width = 11.6, 0.22
    for block, (name, colour) in enumerate(
        (("own", BLUE), ("min", GREEN), ("max", RED), ("mean", OCHRE))
    ):
        cells = features if name == "own" else np.tile(pooled[block - 1], (DRAWN, 1))
        left = own_left + block * FEATURES * width
        _tensor(axes, left, cells, width, colour)
        centre = left + FEATURES * width / 2
        axes.text(centre, TOP + 0.2, name, ha="center", size=9, color=colour)
    _label(axes, 14.24, r"enhanced features $x_{\mathrm{EF}}$", f"[{items}, 4n]", lift=0.75)
    _operation(axes, 17.6, MIDDLE, "relation\nscorer\n$f_4$")
    _tensor(axes, 20.7, values[:, None], 0.44, PURPLE)
    _label(axes, 20.92, "q-values", f"[{items}, 1]")

    # The branch over all items.
    _operation(axes, 8.3, 1.75, "global relation\nextractor $f_2$", width=3.3, height=1.5)
    down, up = 6.88, own_left + 2.5 * FEATURES * width
    shapes_low = TOP - DRAWN * CELL_HEIGHT - 0.75
    _path(axes, [(down, shapes_low), (down, 1.75), (8.3, 1.75)])
    _path(axes, [(11.6, 1.75), (up, 1.75), (up, shapes_low)])
    axes.text(11.75, 1.9, r"$x_{\mathrm{GC}}$  [3n], to each item", size=9, color=INK)

    for start, end in ((1.7, 2.4), (4.9, 5.8), (8.05, 11.5), (16.95, 17.6), (20.1, 20.7)):
        _path(axes, [(start, MIDDLE), (end, MIDDLE)])
    for x, formula, count in (
        (3.65, "linear 3 → n, ReLU\nper item", f"3n + n parameters\n({4 * n} for n = {n})"),
        (9.95, "min, max, mean\nover the items", "no parameters"),
        (18.85, "linear 4n → 1, tanh\nper item", f"4n + 1 parameters\n({4 * n + 1} for n = {n})"),
    ):
        low = 0.85 if x == 9.95 else MIDDLE - 1.4
        axes.text(x, low, formula, ha="center", va="top", size=8.5, color=INK, linespacing=1.3)
        axes.text(x, low - 0.92, count, ha="center", va="top", size=8.5, color="#777777")
    return figure


def _rounded(
    axes: Axes, x: float, y: float, width: float, height: float, size: float = 0.8, **look
) -> None:
    shape = f"round,pad=0,rounding_size={size}"
    axes.add_patch(FancyBboxPatch((x, y), width, height, shape, **look))


def _forward_pass() -> tuple[np.ndarray, ...]:
    """Shades in [0, 1]: observations, features, (min, max, mean) of the features, values."""
    rng = np.random.default_rng(3)
    observed = rng.uniform(-1, 1, (DRAWN, 3))
    features = np.maximum(observed @ rng.normal(size=(3, FEATURES)) + 1, 0)
    features /= features.max()
    pooled = np.array([features.min(axis=0), features.max(axis=0), features.mean(axis=0)])
    values = np.tanh(features @ rng.normal(size=FEATURES) + pooled.mean())
    return (observed + 1) / 2, features, pooled, (values + 1) / 2


def _tensor(axes: Axes, left: float, shades: np.ndarray, width: float, colour: str) -> None:
    """A matrix, one row per item, whose cells are shaded from pale to ``colour``."""
    rows, columns = shades.shape
    x, z = left + width * np.arange(columns + 1), TOP - CELL_HEIGHT * np.arange(rows + 1)
    shade = LinearSegmentedColormap.from_list("shade", ["#f4f4f4", colour])
    axes.pcolormesh(x, z, shades, cmap=shade, vmin=0, vmax=1, edgecolors="white", lw=0.8)
    border = Rectangle((left, z[-1]), x[-1] - left, TOP - z[-1], fill=False, ec=INK, lw=0.8)
    axes.add_patch(border)


def _label(axes: Axes, centre: float, name: str, shape: str, lift: float = 0.2) -> None:
    """The name of a tensor above it and its shape below it."""
    axes.text(centre, TOP + lift, name, ha="center", size=10.5)
    axes.text(centre, TOP - DRAWN * CELL_HEIGHT - 0.2, shape, ha="center", va="top", size=9.5)


def _operation(
    axes: Axes, left: float, middle: float, name: str, width: float = 2.5, height: float = 2.4
) -> None:
    _rounded(
        axes, left, middle - height / 2, width, height, size=0.12, fc="#e8f0f7", ec=BLUE, lw=1.1
    )
    axes.text(left + width / 2, middle, name, ha="center", va="center", size=10)


def _path(axes: Axes, corners: list[tuple[float, float]], style: str | tuple = "-") -> None:
    """A line along the corners that ends in an arrow head."""
    axes.plot(*np.transpose(corners[:-1]), color=INK, lw=1.2, solid_capstyle="butt")
    look = {"arrowstyle": "-|>", "color": INK, "lw": 1.2, "ls": style, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", xy=corners[-1], xytext=corners[-2], arrowprops=look)


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
    # With an empty cell all around: number i here is cell i - 1.
    inside = np.zeros((CELLS_WIDE + 2, CELLS_HIGH + 2), dtype=bool)
    for package, left, lower in boxes:
        width, height = PACKAGES[package]
        inside[left + 1 : left + width + 1, lower + 1 : lower + height + 1] = True
    style = {"color": INK, "lw": 1.8, "solid_capstyle": "projecting"}
    for column, row in np.argwhere(inside[1:] != inside[:-1]):
        across, up = x + column * CELL, z + row * CELL
        axes.plot([across, across], [up - CELL, up], **style)  # row 0 is the margin
    for column, row in np.argwhere(inside[:, 1:] != inside[:, :-1]):
        across, up = x + column * CELL, z + row * CELL
        axes.plot([across - CELL, across], [up, up], **style)
