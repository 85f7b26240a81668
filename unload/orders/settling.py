"""Measured places of boxes, settled: what lies on what, and what stands beside what."""

import numpy as np

from unload.load.boxes import BELOW, CONTACT_TOLERANCE, OVERLAP, Load

SLACK = 0.0005  # m, at each side of a face: physics makes boxes 1 mm narrower


def settle(
    low: np.ndarray, sizes: np.ndarray, container: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Move and shrink boxes until they lie on what is below, clear of what is beside, and inside.

    Each box may be off by ``tolerance``, two of them by twice that from each other. Two boxes that
    share more of depth and of width lie one above the other; others stand side by side. A larger
    fault is left as it is: a ``Load`` of such boxes is refused.

    Args:
        low, sizes: (n, 3) float64, corners nearest to the origin and edge lengths in m.
        container: (3,) float64, in m.
        tolerance: how far boxes may reach into walls, floor or each other, or float, and how
            much smaller they may become where a row is longer than the container, in m.

    Returns:
        How far each centre moves, and by how much each edge becomes smaller, (n, 3) float64 in m
        each; 0 where a box fits.
    """
    high, moved, edges = low + sizes, low.copy(), sizes.copy()
    pair_tolerance = 2 * tolerance

    # From the floor upwards, each box sinks or rises onto the highest one below it.
    top, order = high[:, 2].copy(), np.argsort(low[:, 2], kind="stable")
    for count, box in enumerate(order):
        others = order[:count]
        share = np.minimum(high[box], high[others]) - np.maximum(low[box], low[others])
        beneath = share[:, :2].min(axis=1) > pair_tolerance
        under = others[beneath & (share[:, 2] <= pair_tolerance)]
        most = pair_tolerance if under.size else tolerance
        if abs(low[box, 2] - high[under, 2].max(initial=0)) <= most:
            moved[box, 2] = top[under].max(initial=0)
            top[box] = moved[box, 2] + sizes[box, 2]

    # Those that share height now are pushed apart, along x or y: away from the rear wall or the
    # left one, and back where the container ends.
    for axis in (0, 1):
        end, end_x = container[axis], moved[:, 0] + edges[:, 0]
        order, before = np.argsort(low[:, axis] + high[:, axis], kind="stable"), []
        for count, box in enumerate(order):
            others = order[:count]
            share = np.minimum(high[box], high[others]) - np.maximum(low[box], low[others])
            beside = share[:, axis] <= pair_tolerance
            if axis == 0:  # along y otherwise, or nowhere
                beside &= (share[:, 0] <= share[:, 1]) & (share[:, 1] > -pair_tolerance)
            else:  # what is apart along x needs nothing along y
                depth = np.minimum(end_x[box], end_x[others]) - np.maximum(
                    moved[box, 0], moved[others, 0]
                )
                beside &= depth > OVERLAP
            level = np.minimum(top[box], top[others]) - np.maximum(moved[box, 2], moved[others, 2])
            before.append(others[beside & (level > OVERLAP)])

        # The longest row through a box is the longest path in the graph of neighbours, followed
        # forwards and backwards. If it is too long, all boxes in it become a little smaller.
        wide = sizes[:, axis]
        left, right = np.zeros(len(low)), np.zeros(len(low))
        for box, others in zip(order, before):
            left[box] = (left + wide)[others].max(initial=0)
        for box, others in zip(order[::-1], before[::-1]):
            right[others] = np.maximum(right[others], right[box] + wide[box])
        fitting = wide * np.minimum(1, end / (left + wide + right))
        wide = edges[:, axis] = np.where(wide - fitting <= tolerance, fitting, wide)

        first = np.where(low[:, axis] >= -tolerance, low[:, axis].clip(0), low[:, axis])
        last = np.where(high[:, axis] <= end + tolerance, end - wide, np.inf)
        for box, others in zip(order, before):
            first[box] = max(first[box], (first + wide)[others].max(initial=-np.inf))
        for box, others in zip(order[::-1], before[::-1]):
            last[others] = np.minimum(last[others], last[box] - wide[others])
        moved[:, axis] = np.minimum(first, last)

    smaller = np.where(sizes - edges > OVERLAP / 2, sizes - edges, 0.0)
    moves = moved - low - smaller / 2  # of the centres
    return np.where(np.abs(moves) > OVERLAP / 2, moves, 0.0), smaller


def uncarried(load: Load) -> np.ndarray:
    """The boxes whose centre of mass no support carries, (k,) int64: left alone, they tip.

    A centre is carried if it lies above the floor or within the smallest convex shape around the
    faces that the box stands on, each made smaller by ``SLACK`` as in the physics.
    """
    low, high = load.positions - load.sizes / 2, load.positions + load.sizes / 2
    tipping = []
    for box in np.flatnonzero(low[:, 2] > CONTACT_TOLERANCE).tolist():
        below, centre = load.contacts.of(BELOW, box), load.positions[box]
        start = np.maximum(low[below], low[box]) - centre + SLACK
        end = np.minimum(high[below], high[box]) - centre - SLACK
        x, y = (np.stack([start[:, axis], end[:, axis]]) for axis in (0, 1))
        # Corners all around the centre leave no half of the directions without one.
        angles = np.sort(np.arctan2(y[:, np.newaxis], x).ravel())
        if not below.size or np.diff(angles, append=angles[0] + 2 * np.pi).max() >= np.pi:
            tipping.append(box)
    return np.array(tipping, np.int64)
