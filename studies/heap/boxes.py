"""Turned boxes in a heap: their state, and the geometry that everything else reads from it."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from unload import task
from unload.load.substacks import CELL, PACKAGES, WALLS

REAR = 4.0  # m, x of the wall behind the heap: the last 3 m of the container are played
DOOR = float(task.CONTAINER[0])  # m, x of the entrance
WIDTH = float(task.CONTAINER[1])  # m, y of the right side wall; the left one stands at 0
# m: the conveyor's edge is never farther out. If it always gave way to the foremost face, boxes
# that come out without passing it would push it away: after 15 picks it stood 0.7 to 0.9 m outside
# the door, and random picks unloaded a quarter fewer boxes. Of the boxes of a fresh heap, each must
# move by 0.2 m to pass it, so that creeping ones do not count.
FARTHEST_EDGE = DOOR + 0.2


@dataclass(frozen=True, repr=False, eq=False)  # arrays have no single truth value
class Heap:
    """Boxes at rest, in any orientation.

    This is all that is known of a heap, so that a pick is a function of it: each begins with
    all boxes at rest.

    Attributes:
        positions: (n, 3) float64, centres in m.
        orientations: (n, 4) float64, quaternions x, y, z, w of length 1.
        sizes: (n, 3) float64, edge lengths in m along the box's own axes.
        packages: (n,) int64, package number 0–12.
    """

    positions: np.ndarray
    orientations: np.ndarray
    sizes: np.ndarray
    packages: np.ndarray

    def __post_init__(self) -> None:
        for name, array in vars(self).items():
            array = array.copy()
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return len(self.positions)

    def __repr__(self) -> str:
        return f"Heap({len(self)} boxes)"

    def only(self, boxes: np.ndarray) -> "Heap":
        """The heap of some of the boxes, given as numbers or as (n,) bool."""
        return Heap(*(array[boxes] for array in vars(self).values()))

    def axes(self) -> np.ndarray:
        """(n, 3, 3) float64: in column j, the direction of a box's own axis j."""
        if not len(self):
            return np.zeros((0, 3, 3))
        return Rotation.from_quat(self.orientations).as_matrix()

    def extents(self) -> np.ndarray:
        """(n, 3) float64, m: edges of the upright block around each turned box."""
        return (np.abs(self.axes()) @ self.sizes[:, :, None])[:, :, 0]

    def tilts(self) -> np.ndarray:
        """(n,) float64, rad: angle between the vertical and the box's axis nearest to it."""
        return np.arccos(np.minimum(np.abs(self.axes()[:, 2]).max(axis=1), 1))

    def edge(self) -> float:
        """x of the conveyor's edge, m.

        It is at the foremost face, at the rear wall if there is no box, but at most at
        ``FARTHEST_EDGE``.
        """
        front = (self.positions[:, 0] + self.extents()[:, 0] / 2).max(initial=REAR)
        return min(float(front), FARTHEST_EDGE)


def package_sizes(packages: np.ndarray) -> np.ndarray:
    """(n, 3) float64, m: depth, width and height of packages as in the neat loads."""
    depths = np.full(len(packages), task.CONTAINER[0] / WALLS)
    return np.column_stack([depths, PACKAGES[packages] * CELL])
