"""The permutation-equivariant network (Fig. 7), and what its scores look like."""

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch, Rectangle

from unload import task
from unload.reproduce.style import styled

ROWS, FEATURES = 7, 6  # items and features that are drawn, of 128 and n
TOP, CELL_HEIGHT = 6.2, 0.36  # of the tensors
MIDDLE = TOP - ROWS * CELL_HEIGHT / 2  # height of the main line of arrows
INK = "#333333"
BLUE, GREEN, RED, OCHRE, PURPLE = "#2878b5", "#45a661", "#de5638", "#c98a1b", "#9467bd"


@styled
def fig07_network(n_features: int = 64) -> Figure:
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
        cells = features if name == "own" else np.tile(pooled[block - 1], (ROWS, 1))
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
    shapes_low = TOP - ROWS * CELL_HEIGHT - 0.75
    _line(axes, [(down, shapes_low), (down, 1.75), (8.3, 1.75)])
    _line(axes, [(11.6, 1.75), (up, 1.75), (up, shapes_low)])
    axes.text(11.75, 1.9, r"$x_{\mathrm{GC}}$  [3n], to each item", size=9, color=INK)

    for start, end in ((1.7, 2.4), (4.9, 5.8), (8.05, 11.5), (16.95, 17.6), (20.1, 20.7)):
        _line(axes, [(start, MIDDLE), (end, MIDDLE)])
    for x, formula, count in (
        (3.65, "linear 3 → n, ReLU\nper item", f"3n + n parameters\n({4 * n} for n = {n})"),
        (9.95, "min, max, mean\nover the items", "no parameters"),
        (18.85, "linear 4n → 1, tanh\nper item", f"4n + 1 parameters\n({4 * n + 1} for n = {n})"),
    ):
        low = 0.85 if x == 9.95 else MIDDLE - 1.4
        axes.text(x, low, formula, ha="center", va="top", size=8.5, color=INK, linespacing=1.3)
        axes.text(x, low - 0.92, count, ha="center", va="top", size=8.5, color="#777777")
    return figure


@styled
def score_landscapes(
    observed: np.ndarray,
    grid: np.ndarray,
    fields: Sequence[np.ndarray],
    choices: Sequence[int],
    titles: Sequence[str],
) -> Figure:
    """Scores that networks give to an imagined item, over the side view of an observation.

    Args:
        observed: (items, 3) float, scaled positions, drawn as dots.
        grid: (k,) float, the imagined item's places along both axes.
        fields: of each network the scores, (k, k) float, rows along z, columns along x.
        choices: of each network the row of ``observed`` that it picks, drawn as a star.
        titles: one for each network.
    """
    figure, panels = plt.subplots(
        1, len(fields), figsize=(3.5 * len(fields), 3.4), sharey=True, squeeze=False
    )
    for axes, field, choice, title in zip(panels[0], fields, choices, titles):
        drawn = axes.contourf(grid, grid, field, levels=20, cmap="viridis")
        axes.plot(observed[:, 0], observed[:, 2], "k.", ms=4, label="items")
        star = {"ms": 16, "color": "white", "mec": "black", "mew": 1.2, "ls": "none"}
        axes.plot(*observed[choice, [0, 2]], "*", label="choice", **star)
        axes.set(title=title, xlabel=r"$\tilde p_\mathrm{x}$", aspect="equal")
        figure.colorbar(drawn, ax=axes, format="%.2f")
    panels[0, 0].set_ylabel(r"$\tilde p_\mathrm{z}$")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=2)
    return figure


@styled
def score_gradients(observed: np.ndarray, scores: np.ndarray, jacobian: np.ndarray) -> Figure:
    """What scores depend on: arrows at the items of the front wall, and the size of all entries.

    Args:
        observed: (items, 3) float, scaled positions; the front wall is where x is above 0.9.
        scores: (items,) float.
        jacobian: (items, items, 3) float, entry [i, j] is the gradient of the score of item i
            in the position of item j.
    """
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.9))
    front = observed[:, 0] > 0.9
    y, z = observed[front, 1], observed[front, 2]
    own = jacobian.diagonal(axis1=0, axis2=1).T[front]
    dots = left.scatter(y, z, c=scores[front], s=30, cmap="viridis")
    left.quiver(y, z, own[:, 1], own[:, 2], color=INK, width=0.004)
    left.set(xlabel=r"$\tilde p_\mathrm{y}$", ylabel=r"$\tilde p_\mathrm{z}$")
    left.set_title("front wall: scores, and gradients in the own position")
    left.margins(0.08)
    figure.colorbar(dots, ax=left, label="score")
    size = np.linalg.norm(jacobian, axis=2)
    drawn = right.imshow(np.log10(np.maximum(size, 1e-8)), cmap="magma")
    right.set(xlabel="position of item j", ylabel="score of item i")
    right.set_title("size of the gradient")
    right.grid(False)
    figure.colorbar(drawn, ax=right, label="power of ten")
    return figure


def _forward_pass() -> tuple[np.ndarray, ...]:
    """Shades in [0, 1]: observations, features, (min, max, mean) of the features, values."""
    rng = np.random.default_rng(3)
    observed = rng.uniform(-1, 1, (ROWS, 3))
    features = np.maximum(observed @ rng.normal(size=(3, FEATURES)) + 1, 0)
    features /= features.max()
    pooled = np.array([features.min(axis=0), features.max(axis=0), features.mean(axis=0)])
    values = np.tanh(features @ rng.normal(size=FEATURES) + pooled.mean())
    return (observed + 1) / 2, features, pooled, (values + 1) / 2


def _tensor(axes: Axes, left: float, shades: np.ndarray, width: float, colour: str) -> None:
    """A matrix, one row per item, whose cells are shaded from pale to ``colour``."""
    shade = LinearSegmentedColormap.from_list("shade", ["#f4f4f4", colour])
    for row, cells in enumerate(shades):
        for column, value in enumerate(cells):
            corner = (left + column * width, TOP - (row + 1) * CELL_HEIGHT)
            axes.add_patch(
                Rectangle(corner, width, CELL_HEIGHT, fc=shade(value), ec="white", lw=0.8)
            )
    height, total = len(shades) * CELL_HEIGHT, shades.shape[1] * width
    axes.add_patch(Rectangle((left, TOP - height), total, height, fill=False, ec=INK, lw=0.8))


def _label(axes: Axes, centre: float, name: str, shape: str, lift: float = 0.2) -> None:
    """The name of a tensor above it and its shape below it."""
    axes.text(centre, TOP + lift, name, ha="center", size=10.5)
    axes.text(centre, TOP - ROWS * CELL_HEIGHT - 0.2, shape, ha="center", va="top", size=9.5)


def _operation(
    axes: Axes, left: float, middle: float, name: str, width: float = 2.5, height: float = 2.4
) -> None:
    axes.add_patch(
        FancyBboxPatch(
            (left + 0.12, middle - height / 2 + 0.12), width - 0.24, height - 0.24,
            boxstyle="round,pad=0.12", fc="#e8f0f7", ec=BLUE, lw=1.1,
        )
    )  # fmt: skip
    axes.text(left + width / 2, middle, name, ha="center", va="center", size=10)


def _line(axes: Axes, corners: list[tuple[float, float]]) -> None:
    """A line along the corners that ends in an arrow head."""
    axes.plot(*np.transpose(corners[:-1]), color=INK, lw=1.1, solid_capstyle="butt")
    axes.annotate(
        "",
        xy=corners[-1],
        xytext=corners[-2],
        arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 1.1, "shrinkA": 0, "shrinkB": 0},
    )
