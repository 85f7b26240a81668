"""A still picture of boxes, for where an interactive view is not drawn.

The boxes are drawn from the back to the front, so that nearer ones cover farther ones.
"""

import io
from collections.abc import Iterable, Mapping

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from PIL import Image

from unload import task
from unload.load.contacts import OVERLAP, slabs

# From outside, over the left edge of the entrance, which is the side of x = 7 m.
EYE = np.array([11.6, -2.9, 4.4])  # m
TARGET = np.array([4.4, 1.1, 0.9])  # m
CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
# The faces whose outer sides point along x, against y and along z: corners, and brightness.
FACES = (((4, 6, 7, 5), 0.88), ((0, 4, 5, 1), 0.72), ((1, 5, 7, 3), 1.0))
WIDTH = 8.0  # inches, at 100 pixels each
COLOURS = 128  # of the file, besides those of the boxes
LEGEND = 0.15  # share of the width at the left


def still(
    low: np.ndarray,
    high: np.ndarray,
    colours: np.ndarray,
    legend: Mapping[str, tuple[float, float, float]],
    height: float,
) -> bytes:
    """Return a PNG picture of boxes in the container, seen from ``EYE``, with a legend.

    Args:
        low, high: (n, 3) float64, corners in m.
        colours: (n, 3) float64, RGB in [0, 1].
        legend: name → colour.
        height: of the picture in inches.
    """
    figure = Figure((WIDTH, height), dpi=100, facecolor="white", layout="none")
    axes = figure.add_axes((LEGEND, 0, 1 - LEGEND, 1))
    walls = np.array([(0, 0, 0), task.CONTAINER])
    for edge in _edges(*walls):
        axes.plot(*project(edge).T, color="0.6", linewidth=0.8, zorder=0)
    order = back_to_front(low, high)
    corners = project(low[order, None] + CORNERS * (high - low)[order, None])
    polygons = np.stack([corners[:, list(face)] for face, _ in FACES], axis=1).reshape(-1, 4, 2)
    shades = np.array([shade for _, shade in FACES])[:, None] * colours[order, None]
    axes.add_collection(
        PolyCollection(
            polygons,
            facecolors=shades.reshape(-1, 3),
            edgecolors=0.55 * shades.reshape(-1, 3),
            linewidths=0.5,
        )
    )
    frame = project(walls[0] + CORNERS * task.CONTAINER)
    axes.set(aspect="equal", xlim=_wider(frame[:, 0]), ylim=_wider(frame[:, 1]))
    axes.axis("off")
    handles = [Patch(facecolor=colour, edgecolor="0.5", label=n) for n, colour in legend.items()]
    figure.legend(handles=handles, loc="upper left", fontsize=8, frameon=False)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    file = io.BytesIO()
    picture = np.asarray(canvas.buffer_rgba())[:, :, :3]
    _with_few_colours(picture, legend.values()).save(file, "PNG", optimize=True)
    return file.getvalue()


def _with_few_colours(picture: np.ndarray, boxes: Iterable) -> Image.Image:
    """Reduce the colours, which takes a quarter of the bytes; those of boxes stay as they are."""
    shades = np.multiply.outer([1, *(shade for _, shade in FACES)], np.reshape([*boxes], (-1, 3)))
    kept = np.unique(np.rint(255 * np.vstack([*shades, (1, 1, 1)])), axis=0)
    others = Image.fromarray(picture).quantize(COLOURS).getpalette()[: 3 * COLOURS]
    palette = np.vstack([kept, np.reshape(others, (-1, 3))]).astype(int)
    codes, pixels = np.unique(picture @ np.array((1 << 16, 1 << 8, 1)), return_inverse=True)
    apart = (codes[:, None] >> (16, 8, 0) & 255)[:, None] - palette
    nearest = (apart**2).sum(axis=2).argmin(axis=1).astype(np.uint8)
    image = Image.fromarray(nearest[pixels].reshape(picture.shape[:2]))
    image.putpalette(palette.ravel().tolist())
    return image


def project(points: np.ndarray) -> np.ndarray:
    """Where points (..., 3) in m are seen from ``EYE``, (..., 2), right and up."""
    ahead = (TARGET - EYE) / np.linalg.norm(TARGET - EYE)
    right = np.cross(ahead, (0, 0, 1))
    right /= np.linalg.norm(right)
    seen = (points - EYE) @ np.array([right, np.cross(right, ahead), ahead]).T
    return seen[..., :2] / seen[..., 2:]


def back_to_front(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return an order of disjoint boxes in which none is hidden by an earlier one, (n,) int64.

    The eye is outside the container, beyond its entrance, left wall and ceiling. Therefore
    of two boxes that a plane separates, only the one at the plane's greater x, smaller y or
    greater z can hide the other.
    """
    order = []
    groups = slabs(low[:, 0] + OVERLAP, high[:, 0])
    for group in range(groups.max(initial=-1) + 1):
        left = np.flatnonzero(groups == group)
        low_left, high_left = low[left], high[left]
        behind = _separated(low_left, high_left, 0) | _separated(low_left, high_left, 2)
        behind |= _separated(low_left, high_left, 1).T
        behind &= ~behind.T  # separated both ways: neither hides the other
        while len(left):
            free = ~behind.any(axis=0)
            if not free.any():  # boxes that hide each other in a circle: the farthest first
                free[np.linalg.norm(low[left] - EYE, axis=1).argmax()] = True
            order.append(left[free])
            left, behind = left[~free], behind[np.ix_(~free, ~free)]
    return np.concatenate([*order, np.zeros(0, np.int64)])


def _separated(low: np.ndarray, high: np.ndarray, axis: int) -> np.ndarray:
    """(n, n) bool, whether box i ends where box j begins, or before."""
    return high[:, None, axis] <= low[None, :, axis] + OVERLAP


def _edges(low: np.ndarray, high: np.ndarray) -> list[np.ndarray]:
    """The twelve edges of a box, (2, 3) each."""
    corners = low + CORNERS * (high - low)
    pairs = [(a, b) for a in range(8) for b in range(a) if (CORNERS[a] != CORNERS[b]).sum() == 1]
    return [corners[list(pair)] for pair in pairs]


def _wider(values: np.ndarray, margin: float = 0.04) -> tuple[float, float]:
    room = margin * np.ptp(values)
    return values.min() - room, values.max() + room
