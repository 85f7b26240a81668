"""What the agent sees: the items nearest to the entrance, scaled (Sec. III-B)."""

import numpy as np

from unload import checks, task


def distance(positions: np.ndarray) -> np.ndarray:
    """Weighted distance d of each item to the viewpoint.

    Args:
        positions: (n, 3) float, centres in m.

    Returns:
        (n,) float64: m, y not counting and z counting double.
    """
    positions = checks.finite_array("positions", positions, (None, 3))
    offset = task.VIEWPOINT - positions
    return np.sqrt(offset**2 @ task.DISTANCE_WEIGHTS)


def nearest(positions: np.ndarray, count: int = task.N_VISIBLE) -> np.ndarray:
    """The items that are observed.

    Args:
        positions: (n, 3) float, centres in m.
        count: how many to observe.

    Returns:
        (count,) int64, indices of the nearest items, nearest first. Of items at the same
        distance the one with the smaller index comes first.

    Raises:
        ValueError: there are fewer than ``count`` positions.
    """
    distances = distance(positions)
    if len(distances) < checks.integer("count", count, 1):
        raise ValueError(f"positions holds {len(distances)} items; expected at least {count}")
    return np.argsort(distances, kind="stable")[:count]


def scale(positions: np.ndarray) -> np.ndarray:
    """Positions relative to the container.

    Args:
        positions: (n, 3) float, in m.

    Returns:
        (n, 3) float32, [-1, 1] from one side of the container to the other.
    """
    positions = checks.finite_array("positions", positions, (None, 3))
    return (2 / task.CONTAINER * positions - 1).astype(np.float32)
