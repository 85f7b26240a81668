"""Pictures of a heap."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.path import Path

from studies.heap.boxes import FARTHEST_EDGE, REAR, WIDTH, Heap
from studies.heap.rake import Outcome
from unload.drawing.picture import COLOURS, CORNERS, EYE, SEAM, project

# What happens to a box in a pick, and its colour. The later ones win.
MEANINGS = {
    "stays": COLOURS["unseen"],
    "comes along": COLOURS["liftable"],
    "falls": COLOURS["failed"],
    "is dragged": COLOURS["tried"],
}
OUTSIDE = FARTHEST_EDGE + 0.6  # m, how far the pictures reach
# The outer sides of these faces point against and along a box's own axes, one after the other.
FACES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
LIGHT = np.array([0.55, -0.45, 0.7]) / np.linalg.norm([0.55, -0.45, 0.7])


def corners(heap: Heap) -> np.ndarray:
    """(n, 8, 3) float64, m: corners of the boxes as they are drawn, a little smaller."""
    own = (CORNERS - 0.5) * np.maximum(heap.sizes - SEAM, heap.sizes / 2)[:, None]
    return heap.positions[:, None] + own @ heap.axes().transpose(0, 2, 1)


def draw_heap(axes: Axes, heap: Heap, colours: np.ndarray | None = None, title: str = "") -> None:
    """Draw a heap as seen from outside the door, the conveyor's edge as a line on the floor.

    Args:
        axes: where.
        heap: the boxes.
        colours: (n, 3) float in [0, 1], red, green and blue of each box; all stay if None.
        title: of the picture.
    """
    for line in _room(heap.edge()):
        axes.plot(*project(line).T, color="0.6", lw=0.8, zorder=0)
    boxes, faces, normals = _faces(heap)
    shade = 0.72 + 0.28 * (normals @ LIGHT)
    colours = np.tile(MEANINGS["stays"], (len(heap), 1)) if colours is None else colours
    colours = colours[boxes] * shade[:, None]
    axes.add_collection(
        PolyCollection(
            faces,
            facecolors=np.clip(colours, 0, 1),
            edgecolors=0.5 * np.clip(colours, 0, 1),
            linewidths=0.4,
        )
    )
    frame = project(
        np.array([(x, y, z) for x in (REAR, OUTSIDE) for y in (0, WIDTH) for z in (0, 2.3)])
    )
    axes.set(
        aspect="equal",
        xlim=(frame[:, 0].min(), frame[:, 0].max()),
        ylim=(frame[:, 1].min(), frame[:, 1].max()),
        title=title,
    )
    axes.axis("off")


def box_at(heap: Heap, x: float, y: float) -> int | None:
    """The box that ``draw_heap`` shows at a point of its axes; None if there is none."""
    boxes, faces, _ = _faces(heap)
    here = [box for box, face in zip(boxes, faces) if Path(face).contains_point((x, y))]
    return int(here[-1]) if here else None


def outcome_colours(outcome: Outcome, box: int) -> np.ndarray:
    """(n, 3) float, the colour in ``MEANINGS`` of what a pick does to each box before it."""
    stays, comes, falls, dragged = MEANINGS.values()
    colours = np.tile(stays, (len(outcome.unloaded), 1))
    colours[outcome.unloaded] = comes
    colours[outcome.fallen] = falls
    colours[box] = dragged
    return colours


def add_legend(figure: Figure) -> None:
    handles = [Patch(facecolor=c, edgecolor="0.5", label=name) for name, c in MEANINGS.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(MEANINGS), frameon=False)


def _faces(heap: Heap) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The faces that point to the eye, the farthest first.

    Returns:
        (k,) int, the box of each; (k, 4, 2) float64, its corners in the picture; (k, 3) float64,
        its outward normal.
    """
    faces = corners(heap)[:, FACES].reshape(-1, 4, 3)
    middle, turns = faces.mean(axis=1), heap.axes().transpose(0, 2, 1)
    normals = np.stack([-turns, turns], axis=2).reshape(-1, 3)  # in the order of FACES
    towards = ((EYE - middle) * normals).sum(axis=1) > 0
    order = np.argsort(-np.linalg.norm(middle - EYE, axis=1), kind="stable")
    order = order[towards[order]]
    return order // len(FACES), project(faces[order]), normals[order]


def _room(edge: float) -> list[np.ndarray]:
    """Lines (2, 3): the floor's outline, the rear wall's, and the conveyor's edge."""
    rear = [(REAR, 0, 0), (REAR, WIDTH, 0), (REAR, WIDTH, 2.3), (REAR, 0, 2.3)]
    lines = list(zip(rear, rear[1:] + rear[:1]))
    lines += [((REAR, y, 0), (OUTSIDE, y, 0)) for y in (0, WIDTH)]
    return [np.array(line) for line in (*lines, ((edge, 0, 0), (edge, WIDTH, 0)))]
