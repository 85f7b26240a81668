"""The agent's observation: the items nearest to the entrance, scaled (Sec. III-B).

The last items of a container fill the first rows of the observation only. The rows after
them hold ``task.PADDING`` on all three axes: the corner of the container, where no item's centre
can lie.
"""

import numpy as np

from unload import task

# Drift of the boxes of a settled full simulation, measured in notebook 02: how far they
# spread around the places they were put at, and how far they sink on average (m).
POSITION_NOISE = 0.0005
SINK = 0.001
MOST_NOISE = 10.0  # m, more than the container is long
_VIEWPOINT = task.VIEWPOINT / task.CONTAINER  # as a share of the container


def distance(positions: np.ndarray, container: np.ndarray = task.CONTAINER) -> np.ndarray:
    """Weighted distance d to the viewpoint of centres at ``positions``, (n, 3) float in m.

    The viewpoint is the middle of the upper edge of the container's entrance. ``container``, here
    and below, is a load's.

    Returns:
        (n,) float64: m, y not counting and z counting double.
    """
    offset = container * _VIEWPOINT - positions
    return np.sqrt(offset**2 @ task.DISTANCE_WEIGHTS)


def nearest(
    positions: np.ndarray, count: int = task.N_VISIBLE, container: np.ndarray = task.CONTAINER
) -> np.ndarray:
    """The items that are observed.

    Args:
        positions: (n, 3) float, centres in m.
        count: how many to observe, if there are as many.

    Returns:
        (min(count, n),) int64, indices of the nearest items, nearest first. Of items at the
        same distance the one with the smaller index comes first.
    """
    return np.argsort(distance(positions, container), kind="stable")[:count]


def scale(positions: np.ndarray, container: np.ndarray = task.CONTAINER) -> np.ndarray:
    """Positions relative to the container; what is outside is seen at its edge.

    Args:
        positions: (n, 3) float, in m.

    Returns:
        (n, 3) float32, [-1, 1] from one side of the container to the other.
    """
    return np.clip((2 / container * positions - 1).astype(np.float32), -1, 1)


def drift(count: int, position_noise: float, rng: np.random.Generator) -> np.ndarray:
    """Return position noise, as large as a full simulation's drift, (count, 3) float64 in m."""
    noise = rng.normal(0, position_noise, (count, 3))
    if position_noise:
        noise[:, 2] -= SINK
    return noise


def holds_item(observations: np.ndarray) -> np.ndarray:
    """Return the mask of the rows that hold an item.

    Args:
        observations: (..., items, 3) float, scaled positions. Equalized ones do not show it:
            an item that is first on every axis has -1 three times, as padding does.

    Returns:
        (..., items) bool.
    """
    return (np.asarray(observations) != task.PADDING).any(axis=-1)
