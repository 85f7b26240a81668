"""A depth camera before the door: which boxes it sees, and the boxes one can make of its points."""

from dataclasses import dataclass

import numpy as np

from unload.heap.boxes import DOOR, WIDTH, Heap
from unload.heap.rake import add_walls
from unload.physics.bullet import World

PIXELS_WIDE, PIXELS_HIGH = 128, 96
ANGLE = 50.0  # degrees, from the lower to the upper edge
EYE = (DOOR + 2.0, WIDTH / 2, 2.4)  # m: outside, so that a heap that reaches the door fits in
TARGET = (5.4, WIDTH / 2, 0.8)  # m
SEEN = 4  # pixels that make a box visible: three points span a face, and one may be noise
PIXELS = PIXELS_WIDE * PIXELS_HIGH
CONSTANTS = (PIXELS_WIDE, PIXELS_HIGH, ANGLE, EYE, TARGET, SEEN)  # what a scan depends on


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
