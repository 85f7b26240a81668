"""What a policy sees of a heap: one row of numbers per visible box."""

from dataclasses import dataclass

import numpy as np

from unload.heap.boxes import FARTHEST_EDGE, WIDTH, Heap
from unload.heap.camera import SEEN, Scan, visible_boxes

ROWS = 96  # about 55 boxes are visible; if more are, those farthest from the door are left out
COLUMNS = (
    "behind", "y", "z", "extent_x", "extent_y", "extent_z", "longest", "middle", "shortest",
    "tilt", "clear_above", "clear_in_front", "pixels",
)  # fmt: skip
COLUMN = {name: number for number, name in enumerate(COLUMNS)}
UNLOADED, FELL = 1, 2  # bits of what a pick has done to a box
PIXEL_UNIT = 1000.0  # of the last column, so that all columns are of the order of 1


@dataclass(frozen=True, eq=False)
class SeenBoxes:
    """Visible boxes as they are, or as a camera's points suggest that they are.

    Attributes:
        numbers: (m,) int64, of the boxes in the heap, from the door to the rear.
        centres: (m, 3) float64, m.
        extents: (m, 3) float64, m, edges of the upright block around each box.
        edges: (m, 3) float64, m, of the box itself, longest first.
        tilts: (m,) float64, rad, as ``Heap.tilts``.
        pixels: (m,) int64.
    """

    numbers: np.ndarray
    centres: np.ndarray
    extents: np.ndarray
    edges: np.ndarray
    tilts: np.ndarray
    pixels: np.ndarray

    def ordered(self) -> "SeenBoxes":
        """The ``ROWS`` boxes nearest to the door, the foremost first."""
        rows = np.argsort(-self.centres[:, 0], kind="stable")[:ROWS]
        return SeenBoxes(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))


def true_boxes(heap: Heap, scan: Scan) -> SeenBoxes:
    """The visible boxes as they are: whatever part of a box shows, all of it is known."""
    seen = visible_boxes(scan)
    part = heap.only(seen)
    return SeenBoxes(
        seen,
        part.positions,
        part.extents(),
        -np.sort(-part.sizes, axis=1),
        part.tilts(),
        scan.pixels[seen],
    ).ordered()


def camera_boxes(heap: Heap, scan: Scan) -> SeenBoxes:
    """The visible boxes as their visible points suggest: nothing is known of what is hidden.

    The points of a box are a cluster, which the segmentation gives without error. Its centre
    and extents are those of the upright block around its points; its own axes are the
    principal ones of the points, and its edges their spans along these. Only if no box is
    visible, all are given as they are, because else nothing could be picked.
    """
    seen = visible_boxes(scan)
    if scan.pixels[seen].min() < SEEN:
        return true_boxes(heap, scan)
    clusters = [scan.points[scan.owners == number] for number in seen]
    low = np.array([points.min(axis=0) for points in clusters])
    high = np.array([points.max(axis=0) for points in clusters])
    edges, tilts = zip(*map(_principal, clusters))
    return SeenBoxes(
        seen, (low + high) / 2, high - low, np.array(edges), np.array(tilts), scan.pixels[seen]
    ).ordered()


def _principal(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Spans along the principal axes, longest first, and the tilt of these axes."""
    axes = np.linalg.eigh(np.cov(points.T))[1]  # in its columns
    spans = -np.sort(-np.ptp(points @ axes, axis=0))
    return spans, float(np.arccos(min(np.abs(axes[2]).max(), 1.0)))


def features(seen: SeenBoxes) -> np.ndarray:
    """(96, 13) float32, the observation; rows without a box are 0.

    See ``HeapEnv`` for the columns.
    """
    count = len(seen.numbers)
    low, high = seen.centres - seen.extents / 2, seen.centres + seen.extents / 2
    edge = min(high[:, 0].max(initial=-np.inf), FARTHEST_EDGE)
    rows = np.zeros((ROWS, len(COLUMNS)), np.float32)
    rows[:count] = np.column_stack(
        [
            edge - seen.centres[:, 0],
            seen.centres[:, 1] - WIDTH / 2,
            seen.centres[:, 2],
            seen.extents,
            seen.edges,
            seen.tilts,
            1 - _covered(low, high, seen.centres, 2),
            1 - _covered(low, high, seen.centres, 0),
            seen.pixels / PIXEL_UNIT,
        ]
    )
    return rows


def _covered(low: np.ndarray, high: np.ndarray, centres: np.ndarray, axis: int) -> np.ndarray:
    """(m,) share of each block's face across ``axis`` that blocks farther along it cover.

    The shares of several blocks are added, up to 1, although they may overlap.
    """
    others = [k for k in range(3) if k != axis]
    low, high = low[:, others], high[:, others]
    overlap = np.minimum(high[:, None], high) - np.maximum(low[:, None], low)
    areas = np.maximum(overlap, 0).prod(axis=2)
    beyond = centres[:, None, axis] < centres[None, :, axis]
    faces = np.maximum((high - low).prod(axis=1), 1e-9)
    return np.minimum((areas * beyond).sum(axis=1) / faces, 1)
