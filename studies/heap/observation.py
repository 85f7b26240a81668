"""What a policy sees of a heap: a camera's view, one row of numbers per visible box."""

import numpy as np

from studies.heap.boxes import DOOR, WIDTH, Heap
from studies.heap.rake import fill
from unload.physics.bullet import World

PIXELS_WIDE, PIXELS_HIGH = 128, 96
ANGLE = 50.0  # degrees, from the lower to the upper edge
EYE = (DOOR + 2.0, WIDTH / 2, 2.4)  # m: outside, so that a heap that reaches the door fits in
TARGET = (5.4, WIDTH / 2, 0.8)  # m
NEAR_PLANE, FAR_PLANE = 0.1, 50.0  # m
SEEN = 4  # pixels that make a box visible
ROWS = 96  # about 55 boxes are visible; if more are, those farthest from the door are left out
COLUMNS = (
    "behind", "y", "z", "extent_x", "extent_y", "extent_z", "longest", "middle", "shortest",
    "tilt", "clear_above", "clear_in_front", "pixels",
)  # fmt: skip
COLUMN = {name: number for number, name in enumerate(COLUMNS)}
UNLOADED, FELL = 1, 2  # bits of what a pick has done to a box
PIXEL_UNIT = 1000.0  # of the last column, so that all columns are of the order of 1


class Camera:
    """Photographs heaps by PyBullet's TinyRenderer, in a client of its own."""

    def __init__(self) -> None:
        self._world = World()

    def pixels(self, heap: Heap) -> np.ndarray:
        """(n,) int64, how many of the 128 × 96 pixels show each box."""
        bodies = list(fill(self._world, heap, mass=0).values())
        client, shape = self._world.client, (PIXELS_WIDE, PIXELS_HIGH)
        *_, shown = client.getCameraImage(
            *shape,
            client.computeViewMatrix(EYE, TARGET, (0, 0, 1)),
            client.computeProjectionMatrixFOV(ANGLE, shape[0] / shape[1], NEAR_PLANE, FAR_PLANE),
            renderer=client.ER_TINY_RENDERER,
        )
        boxes = np.full(max(bodies, default=0) + 2, -1)  # -1: walls, and nothing at all
        boxes[bodies] = np.arange(len(heap))
        owners = boxes[np.ravel(shown)]
        return np.bincount(owners[owners >= 0], minlength=len(heap))


def visible_boxes(heap: Heap, pixels: np.ndarray) -> np.ndarray:
    """(m,) int64, the up to ``ROWS`` boxes that can be picked, from the door to the rear.

    They are those that at least ``SEEN`` pixels show; all if there is none.
    """
    seen = np.flatnonzero(pixels >= SEEN)
    seen = seen if len(seen) else np.arange(len(heap))
    return seen[np.argsort(-heap.positions[seen, 0], kind="stable")[:ROWS]]


def features(heap: Heap, pixels: np.ndarray) -> np.ndarray:
    """(96, 13) float32, the observation; rows without a box are 0.

    Of a visible box all is known, whatever part of it shows. See ``HeapEnv`` for the columns.

    Args:
        heap: of the visible boxes, in the order of the rows.
        pixels: (m,) int64, that show each of them.
    """
    centres, extents = heap.positions, heap.extents()
    low, high = centres - extents / 2, centres + extents / 2
    rows = np.zeros((ROWS, len(COLUMNS)), np.float32)
    rows[: len(heap)] = np.column_stack(
        [
            heap.edge() - centres[:, 0],
            centres[:, 1] - WIDTH / 2,
            centres[:, 2],
            extents,
            -np.sort(-heap.sizes, axis=1),
            heap.tilts(),
            1 - _covered(low, high, centres, 2),
            1 - _covered(low, high, centres, 0),
            pixels / PIXEL_UNIT,
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
