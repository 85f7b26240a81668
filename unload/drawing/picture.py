"""Still pictures of a load, drawn back to front, so that nearer boxes cover farther ones.

They are what environments render, and stand in where plotly is not drawn. This module takes a third
of a second to import, because Matplotlib does: import it where something is drawn.
"""

import io
from collections.abc import Mapping

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from PIL import Image

from unload import task
from unload.load.boxes import OVERLAP, Load, slabs

# One colour for each meaning, in every picture of a load: Okabe and Ito's colours, which the
# colour-blind tell apart as well; pale for what does not matter.
COLOURS: dict[str, tuple[float, float, float]] = {
    "unseen": (0.86, 0.86, 0.84),
    "visible": (0.34, 0.71, 0.91),
    "liftable": (0.00, 0.62, 0.45),
    "blocked": (0.84, 0.37, 0.00),
    "tried": (0.94, 0.89, 0.26),
    "failed": (0.80, 0.47, 0.65),
    "on top of it": (0.00, 0.45, 0.70),  # of the chosen box
    "cannot move": (0.74, 0.74, 0.72),
}
# Packages 0–12: large packages dark, small ones light.
_PACKAGE_COLOURS = (
    "#1f3a5f", "#2e6f95", "#5fa8d3", "#264d3b", "#3f8f63", "#7a3b69", "#c05299",
    "#e07a5f", "#b5838d", "#f2b880", "#8d6a9f", "#d4a373", "#f6e27f",
)  # fmt: skip
SEAM = 0.012  # m, boxes are drawn this much smaller so that one sees where they end
# From outside, over the left edge of the entrance, which is the side of x = 7 m. ``project`` scales
# those of a container of another size with it.
EYE = np.array([11.6, -2.9, 4.4])  # m
TARGET = np.array([4.4, 1.1, 0.9])  # m
CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
# The faces whose outer sides point along x, against y and along z: corners, and brightness.
_FACES = (((4, 6, 7, 5), 0.88), ((0, 4, 5, 1), 0.72), ((1, 5, 7, 3), 1.0))
# The insides of the container that are seen: corners, and brightness of the grey.
_INSIDES = (((0, 4, 6, 2), 0.91), ((0, 2, 3, 1), 0.94), ((2, 6, 7, 3), 0.87))
# All faces, and their twelve triangles, whose corners go round as seen from outside.
_RINGS = [face for face, _ in _FACES] + [face[::-1] for face, _ in _INSIDES]
TRIANGLES = np.array([(a, b, c, a, c, d) for a, b, c, d in _RINGS]).reshape(12, 3)
_EDGE = 0.55  # brightness of the edge of a face, as a share of that of the face
_WIDTH = 8.0  # inches, at 100 pixels each
_LEGEND = 0.15  # share of the width at the left
_FILE_COLOURS = 128, Image.Quantize.MAXCOVERAGE  # of a still picture; keeps a legend's colours
_NUMBERED = 50  # picks in a picture of an order


def package_colour(package: int) -> tuple[float, float, float]:
    """RGB in [0, 1] of a package; numbers above 12 start again from 0."""
    return to_rgb(_PACKAGE_COLOURS[package % len(_PACKAGE_COLOURS)])


def snapshot(load: Load, present: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Return (480, 640, 3) uint8, a picture of the present items, coloured by package, all upright.

    Their centres are at ``positions``, (n, 3) float in m.
    """
    items = np.flatnonzero(present)
    moved = (positions - load.positions)[items]
    low, high = (corner + moved for corner in corners(load, items))
    colours = np.array([package_colour(package) for package in load.packages[items]])
    container = load.container
    return pixels(_drawn(low, high, colours.reshape(-1, 3), (6.4, 4.8), 0.0, container))


def still(
    low: np.ndarray,
    high: np.ndarray,
    colours: np.ndarray,
    legend: Mapping[str, tuple[float, float, float]],
    height: float,
    container: np.ndarray = task.CONTAINER,
) -> bytes:
    """Return a PNG picture of boxes in the container with a legend.

    Args:
        low, high, colours: see ``draw``; in any order.
        legend: name → colour.
        height: of the picture in inches.
        container: of the load.
    """
    figure = _drawn(low, high, colours, (_WIDTH, height), _LEGEND, container)
    handles = [Patch(facecolor=colour, edgecolor="0.5", label=n) for n, colour in legend.items()]
    figure.legend(handles=handles, loc="upper left", fontsize=8, frameon=False)
    return _png(figure)


def numbered(load: Load, items: np.ndarray) -> bytes:
    """Return a PNG picture of a load whose first fifty picks are coloured and numbered.

    Hidden boxes have no number.

    Args:
        load: as it is before the first pick.
        items: (k,) int, all different, in the order in which they are picked.
    """
    first = items[:_NUMBERED]
    colours = np.tile(COLOURS["unseen"], (len(load), 1))
    colours[first] = colormaps["viridis_r"](np.linspace(0.1, 0.9, len(first)))[:, :3]
    low, high = corners(load, np.arange(len(load)))
    figure = _drawn(low, high, colours, (_WIDTH, _WIDTH * 0.6), 0.0, load.container)

    # A number stands in the middle of a face that no box drawn later covers: a point lies inside of
    # a convex face if it is on the same side of all four edges.
    drawn = np.argsort(back_to_front(low, high))  # the place of each box in the order of drawing
    faces = _faces(low, high, load.container)
    for number, item in enumerate(first.tolist(), 1):
        later = faces[drawn > drawn[item]].reshape(-1, 4, 2)
        for middle in faces[item].mean(axis=1):
            sides, points = np.roll(later, -1, axis=1) - later, middle - later
            turns = sides[..., 0] * points[..., 1] - sides[..., 1] * points[..., 0]
            if not ((turns > 0).all(axis=1) | (turns < 0).all(axis=1)).any():
                x, y = middle.tolist()
                figure.axes[0].text(x, y, str(number), ha="center", va="center", fontsize=6)
                break
    return _png(figure)


def _png(figure: Figure) -> bytes:
    """The file of a figure, in few colours, which take a quarter of the bytes."""
    file = io.BytesIO()
    Image.fromarray(pixels(figure)).quantize(*_FILE_COLOURS).save(file, "PNG", optimize=True)
    return file.getvalue()


def _faces(low: np.ndarray, high: np.ndarray, container: np.ndarray) -> np.ndarray:
    """(n, 3, 4, 2) float64, where the corners of each box's three visible faces are seen."""
    seen = project(low[:, None] + CORNERS * (high - low)[:, None], container)
    return np.stack([seen[:, list(face)] for face, _ in _FACES], axis=1)


def _drawn(low, high, colours, size: tuple[float, float], left: float, container) -> Figure:
    """A figure of boxes in the container, of this size in inches, free in a share at the left."""
    figure = Figure(size, dpi=100, facecolor="white", layout="none")  # type: ignore[arg-type]
    order = back_to_front(low, high)
    axes = figure.add_axes((left, 0, 1 - left, 1))
    draw(axes, low[order], high[order], colours[order], container)
    return figure


def draw(
    axes: Axes,
    low: np.ndarray,
    high: np.ndarray,
    colours: np.ndarray,
    container: np.ndarray = task.CONTAINER,
) -> None:
    """Draw boxes in the container, seen from ``EYE``; the container fills the axes.

    Args:
        axes: Matplotlib's.
        low, high: (n, 3) float64, corners in m, in an order such as that of ``back_to_front``.
        colours: (n, 3) float64, RGB in [0, 1].
        container: of the load.
    """
    # The container's insides lie behind all boxes.
    frame = project(CORNERS * container, container)
    for face, brightness in _INSIDES:
        axes.fill(*frame[list(face)].T, color=str(brightness), zorder=0)

    # Of each box only three faces are seen, because of where the eye is.
    polygons = _faces(low, high, container).reshape(-1, 4, 2)
    shades = np.array([shade for _, shade in _FACES])[:, None] * colours[:, None]
    # In one array, which Matplotlib takes faster than a list.
    axes.add_collection(
        PolyCollection(
            polygons,  # type: ignore[arg-type]
            facecolors=shades.reshape(-1, 3),
            edgecolors=_EDGE * shades.reshape(-1, 3),
            linewidths=0.5,
        )
    )

    margin = 0.04 * np.ptp(frame, axis=0)
    xlim, ylim = zip(frame.min(axis=0) - margin, frame.max(axis=0) + margin)
    axes.set(aspect="equal", xlim=xlim, ylim=ylim)
    axes.axis("off")


def pixels(figure: Figure) -> np.ndarray:
    """(height, width, 3) uint8, a Matplotlib figure as it is drawn."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.array(canvas.buffer_rgba())[:, :, :3]


def corners(load: Load, items: np.ndarray, seam: float = SEAM) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corners of items as they are drawn, (k, 3) float64 each, in m."""
    centres = load.positions[items]
    halves = np.maximum(load.sizes - seam, load.sizes / 2)[items] / 2
    return centres - halves, centres + halves


def project(points: np.ndarray, container: np.ndarray = task.CONTAINER) -> np.ndarray:
    """Where points (..., 3) in m are seen from ``EYE``, (..., 2), right and up."""
    eye, target = (place * (container / task.CONTAINER) for place in (EYE, TARGET))
    ahead = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(ahead, (0, 0, 1))
    right /= np.linalg.norm(right)
    seen = (points - eye) @ np.array([right, np.cross(right, ahead), ahead]).T
    return seen[..., :2] / seen[..., 2:]  # what is farther away looks smaller


def back_to_front(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return an order of disjoint boxes in which none is hidden by an earlier one, (n,) int64.

    The eye is outside the container, beyond its entrance, left wall and ceiling. Therefore
    of two boxes that a plane separates, only the one at the plane's greater x, smaller y or
    greater z can hide the other.
    """
    # Slabs of depth are drawn one after the other, which keeps the matrices of pairs small.
    order = []
    groups = slabs(low[:, 0] + OVERLAP, high[:, 0])
    for group in range(groups.max(initial=-1) + 1):
        left = np.flatnonzero(groups == group)
        # apart[i, j, axis]: box i ends where box j begins, or before. behind[i, j]: a plane has box
        # i on its far side and box j on its near side, so that i is drawn first.
        apart = high[left][:, None] <= low[left] + OVERLAP
        behind: np.ndarray = apart[..., 0] | apart[..., 2] | apart[..., 1].T
        behind &= ~behind.T  # separated both ways: neither hides the other

        # Draw those that have nothing left behind them, until none is left.
        while len(left):
            free = np.asarray(~behind.any(axis=0))
            if not free.any():  # boxes that hide each other in a circle: the farthest first
                free[np.linalg.norm(low[left] - EYE, axis=1).argmax()] = True
            order.append(left[free])
            left, behind = left[~free], behind[np.ix_(~free, ~free)]
    return np.concatenate([*order, np.zeros(0, np.int64)])
