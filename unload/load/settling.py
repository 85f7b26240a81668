"""Measured places of boxes, settled: what lies on what, and what stands beside what."""

import numpy as np

from unload.load.boxes import BELOW, CONTACT_TOLERANCE, OVERLAP, Load

SLACK = 0.0005  # m, at each side of a face: physics makes boxes 1 mm narrower


def settle(
    low: np.ndarray, sizes: np.ndarray, container: np.ndarray, tolerance: float
) -> np.ndarray:
    """How far boxes move until they lie on what is below, clear of what is beside, and inside.

    Two boxes that share more than ``tolerance`` of depth and of width lie one above the other;
    others stand side by side. A fault of more than ``tolerance`` is left as it is: a ``Load`` of
    such boxes is refused.

    Args:
        low, sizes: (n, 3) float64, corners nearest to the origin and edge lengths in m.
        container: (3,) float64, in m.
        tolerance: how far boxes may overlap each other or the walls, or float, in m.

    Returns:
        (n, 3) float64 in m, 0 where a box fits.
    """
    high, found = low + sizes, low.copy()

    def shared(box: int, others: np.ndarray) -> np.ndarray:
        """How much of each axis a box shares with others as they were listed, (k, 3) in m."""
        return np.minimum(high[box], high[others]) - np.maximum(low[box], low[others])

    # From the floor upwards, each box sinks or rises onto the highest one below it.
    top, order = high[:, 2].copy(), np.argsort(low[:, 2], kind="stable")
    for count, box in enumerate(order):
        share = shared(box, order[:count])
        under = order[:count][(share[:, :2].min(axis=1) > tolerance) & (share[:, 2] <= tolerance)]
        if abs(low[box, 2] - high[under, 2].max(initial=0)) <= tolerance:
            found[box, 2] = top[under].max(initial=0)
            top[box] = found[box, 2] + sizes[box, 2]

    # Those that share height now are pushed apart, along x or y: away from the rear wall or the
    # left one, and back where the container ends.
    for axis in (0, 1):
        edges, end = sizes[:, axis], container[axis]
        first = np.where(low[:, axis] >= -tolerance, low[:, axis].clip(0), low[:, axis])
        last = np.where(high[:, axis] <= end + tolerance, end - edges, np.inf)
        order, before = np.argsort(low[:, axis] + high[:, axis], kind="stable"), []
        for count, box in enumerate(order):
            others, share = order[:count], shared(box, order[:count])
            level = np.minimum(top[box], top[others]) - np.maximum(found[box, 2], found[others, 2])
            beside = share[:, axis] <= np.minimum(share[:, 1 - axis], tolerance)
            before.append(others[beside & (level > OVERLAP)])
            first[box] = max(first[box], (first + edges)[before[-1]].max(initial=-np.inf))
        for box, others in zip(order[::-1], before[::-1]):
            last[others] = np.minimum(last[others], last[box] - edges[others])
        found[:, axis] = np.minimum(first, last)
    return np.where(np.abs(found - low) > OVERLAP / 2, found - low, 0.0)


def uncarried(load: Load) -> np.ndarray:
    """The boxes whose centre of mass no support carries, (k,) int64: left alone, they tip.

    A centre is carried if it lies above the floor or within the smallest convex shape around the
    faces that the box stands on, each made smaller by ``SLACK`` as in the physics.
    """
    low, high = load.positions - load.sizes / 2, load.positions + load.sizes / 2
    found = []
    for box in np.flatnonzero(low[:, 2] > CONTACT_TOLERANCE).tolist():
        below, centre = load.contacts.of(BELOW, box), load.positions[box]
        start = np.maximum(low[below], low[box]) - centre + SLACK
        end = np.minimum(high[below], high[box]) - centre - SLACK
        x, y = (np.stack([start[:, axis], end[:, axis]]) for axis in (0, 1))
        # Corners all around the centre leave no half of the directions without one.
        angles = np.sort(np.arctan2(y[:, np.newaxis], x).ravel())
        if not below.size or np.diff(angles, append=angles[0] + 2 * np.pi).max() >= np.pi:
            found.append(box)
    return np.array(found, np.int64)
