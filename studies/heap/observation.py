"""What a policy sees of a heap: a depth camera's view, one row of numbers per visible box."""

from dataclasses import dataclass

import numpy as np

from studies.heap.boxes import DOOR, FARTHEST_EDGE, WIDTH, Heap
from studies.heap.rake import add_walls
from unload.physics.bullet import World

PIXELS_WIDE, PIXELS_HIGH = 128, 96
ANGLE = 50.0  # degrees, from the lower to the upper edge
EYE = (DOOR + 2.0, WIDTH / 2, 2.4)  # m: outside, so that a heap that reaches the door fits in
TARGET = (5.4, WIDTH / 2, 0.8)  # m
SEEN = 4  # pixels that make a box visible: three points span a face, and one may be noise
ROWS = 96  # about 55 boxes are visible; if more are, those farthest from the door are left out
COLUMNS = (
    "behind", "y", "z", "extent_x", "extent_y", "extent_z", "longest", "middle", "shortest",
    "tilt", "clear_above", "clear_in_front", "pixels",
)  # fmt: skip
COLUMN = {name: number for number, name in enumerate(COLUMNS)}
UNLOADED, FELL = 1, 2  # bits of what a pick has done to a box
PIXEL_UNIT = 1000.0  # of the last column, so that all columns are of the order of 1
# What an observation depends on besides the heap.
CONSTANTS = PIXELS_WIDE, PIXELS_HIGH, ANGLE, EYE, TARGET, SEEN


@dataclass(frozen=True, eq=False)
class Scan:
    """One photograph of a heap.

    Attributes:
        pixels: (n,) int64, how many pixels show each box.
        points: (m, 3) float64, m, what the pixels that show boxes see, from the upper left.
        owners: (m,) int64, the box that each point lies on (the segmentation).
    """

    pixels: np.ndarray
    points: np.ndarray
    owners: np.ndarray


class Camera:
    """Photographs heaps by PyBullet's TinyRenderer, in a client of its own."""

    def __init__(self) -> None:
        self._world = World()

    def scan(self, heap: Heap) -> Scan:
        """Photograph a heap: 128 × 96 pixels of depth and segmentation, without noise."""
        world = self._world
        world.clear()
        add_walls(world)
        bodies = [
            world.add_box(place, size, 0, turn)
            for place, size, turn in zip(heap.positions, heap.sizes, heap.orientations)
        ]
        depth, shown = world.scan(EYE, TARGET, PIXELS_WIDE, PIXELS_HIGH, ANGLE)
        boxes = np.full(max(bodies, default=0) + 2, -1)  # -1: walls, and nothing at all
        boxes[bodies] = np.arange(len(heap))
        owners = boxes[shown]
        on_box = owners >= 0
        return Scan(
            np.bincount(owners[on_box], minlength=len(heap)),
            _points(depth)[on_box],
            owners[on_box],
        )

    def close(self) -> None:
        """Disconnect the client; may be called again."""
        self._world.close()


def visible_boxes(scan: Scan) -> np.ndarray:
    """Numbers of the boxes that at least ``SEEN`` pixels show; all of them if there is none."""
    seen = np.flatnonzero(scan.pixels >= SEEN)
    return seen if len(seen) else np.arange(len(scan.pixels))


def _points(depth: np.ndarray) -> np.ndarray:
    """(height, width, 3) float64, m: what each pixel sees, from the depth along the axis."""
    ahead = np.subtract(TARGET, EYE)
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, (0, 0, 1))
    right /= np.linalg.norm(right)
    up = np.cross(right, ahead)
    slope = np.tan(np.radians(ANGLE / 2))
    rows = slope * (1 - 2 * (np.arange(PIXELS_HIGH) + 0.5) / PIXELS_HIGH)
    aspect = PIXELS_WIDE / PIXELS_HIGH
    columns = slope * aspect * (2 * (np.arange(PIXELS_WIDE) + 0.5) / PIXELS_WIDE - 1)
    rays = ahead + rows[:, None, None] * up + columns[:, None] * right
    return EYE + depth[..., None] * rays


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
