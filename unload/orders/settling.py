"""Measured places of boxes, settled: what lies on what, and what stands beside what."""

import numpy as np

from unload.load.boxes import BELOW, CONTACT_TOLERANCE, OVERLAP, Load

SLACK = 0.0005  # m, at each side of a face: physics makes boxes 1 mm narrower
Rows = list[tuple[int, np.ndarray]]  # each box, and all that stand before it in its row


def settle(
    low: np.ndarray, sizes: np.ndarray, container: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Move and shrink boxes until they lie on what is below, clear of what is beside, and inside.

    Each box may be off by ``tolerance``, two of them by twice that from each other. Two boxes that
    share more than twice the tolerance of depth and of width lie one above the other; others stand
    side by side. A larger fault is left as it is: a ``Load`` of such boxes is refused.

    Args:
        low, sizes: (n, 3) float64, corners nearest to the origin and edge lengths in m.
        container: (3,) float64, in m.
        tolerance: how far boxes may reach into walls, floor or each other, or float, and how
            much smaller they may become where a row is longer than the container, in m.

    Returns:
        How far each centre moves, and by how much each edge becomes smaller, (n, 3) float64 in m
        each; 0 where a box fits.
    """
    high, edges = low + sizes, sizes.copy()
    start, end = low.copy(), high.copy()  # of the settled boxes
    start[:, 2] = _bottoms(low, sizes, tolerance)
    end[:, 2] = start[:, 2] + sizes[:, 2]

    # Boxes that now share height are pushed apart along x; then along y those that now share both
    # height and depth.
    for axis in (0, 1):
        rows = _rows(axis, low, high, start, end, tolerance)
        room = container[axis]
        edges[:, axis] = _fitting(sizes[:, axis], rows, room, tolerance)
        start[:, axis] = _apart(low[:, axis], high[:, axis], edges[:, axis], rows, room, tolerance)
        end[:, axis] = start[:, axis] + edges[:, axis]

    smaller = np.where(sizes - edges > OVERLAP / 2, sizes - edges, 0.0)
    moves = start - low - smaller / 2  # of the centres
    return np.where(np.abs(moves) > OVERLAP / 2, moves, 0.0), smaller


def _bottoms(low: np.ndarray, sizes: np.ndarray, tolerance: float) -> np.ndarray:
    """The height of each bottom, (n,) float64, once each box lies on the highest one below it.

    For example, B lies on A, which is 0.5 m high. If they were measured from 0.002 and 0.497 m on,
    A goes down to the floor, and B up to 0.5 m.
    """
    high = low + sizes
    bottom, top = low[:, 2].copy(), high[:, 2].copy()
    order = np.argsort(low[:, 2], kind="stable")  # from the floor upwards
    ordered = low[order], high[order]
    for place, box in enumerate(order):
        others = order[:place]
        share = _shared(*ordered, place)
        beneath = share[:, :2].min(axis=1) > 2 * tolerance
        under = others[beneath & (share[:, 2] <= 2 * tolerance)]
        most = 2 * tolerance if under.size else tolerance  # the floor is where it is
        if abs(low[box, 2] - high[under, 2].max(initial=0)) <= most:
            bottom[box] = top[under].max(initial=0)
            top[box] = bottom[box] + sizes[box, 2]
    return bottom


def _rows(axis: int, low, high, start, end, tolerance: float) -> Rows:
    """The boxes along x or y, from the wall on, each with the ones that stand before it in a row.

    Measured corners say what stands before what, settled ones what shares a height or a depth. For
    example, A reaches from 0 to 1 m along x, and B from 0.996 to 2 m. If both stand on the floor,
    the rows along x are [(A, []), (B, [A])]; if B stands on the height of A's top, or beside A,
    they are [(A, []), (B, [])].
    """
    rows, order = [], np.argsort(low[:, axis] + high[:, axis], kind="stable")
    low, high, start, end = (corners[order] for corners in (low, high, start, end))
    for place, box in enumerate(order):
        share, settled = _shared(low, high, place), _shared(start, end, place)
        # One stands before the other: apart along this axis, but for the fault of both, and at one
        # height. Along x two kinds of pairs are left out: those that overlap less along y than
        # along x, because they are pushed apart along y, and those with a gap between them along
        # y, which need nothing.
        beside = (share[:, axis] <= 2 * tolerance) & (settled[:, 2] > OVERLAP)
        if axis == 0:
            beside &= (share[:, 0] <= share[:, 1]) & (share[:, 1] > -2 * tolerance)
        else:  # what is apart along x needs nothing along y
            beside &= settled[:, 0] > OVERLAP
        rows.append((box, order[:place][beside]))
    return rows


def _shared(low: np.ndarray, high: np.ndarray, place: int) -> np.ndarray:
    """The stretch that a box shares with each one before it on each axis, (place, 3) float64 in m.

    Below 0 it is the gap between them.
    """
    return np.minimum(high[place], high[:place]) - np.maximum(low[place], low[:place])


def _fitting(edges: np.ndarray, rows: Rows, room: float, tolerance: float) -> np.ndarray:
    """Edges along one axis, (n,) float64, a little smaller where a row is longer than the room.

    Of all rows in which a box stands the longest counts. For example, A of 1 m stands before B of
    1.004 m, and the room has 2 m. So ``rows`` is [(A, []), (B, [A])], the row is 2.004 m long, and
    both become shorter by 0.2 %: 0.998 and 1.002 m.
    """
    # The greatest length of the boxes that stand before each one in a row, and after it.
    before, after = np.zeros(len(edges)), np.zeros(len(edges))
    for box, others in rows:
        before[box] = (before[others] + edges[others]).max(initial=0)
    for box, others in rows[::-1]:
        after[others] = np.maximum(after[others], after[box] + edges[box])
    longest = np.maximum(before + edges + after, OVERLAP)  # boxes without a width are refused later
    fitting = edges * np.minimum(1, room / longest)
    return np.where(edges - fitting <= tolerance, fitting, edges)


def _apart(low, high, edges, rows: Rows, room: float, tolerance: float) -> np.ndarray:
    """Where each box begins along one axis, (n,) float64, so that it is clear of its row.

    It is pushed away from the wall by what stands before it, and back where the room ends. For
    example, A and B are 1 m long, and the room has 2 m. If they were measured from 0 and 0.996 m
    on, B is pushed to 1 m; if from 0.003 and 1.004 m on, B is pushed back to 1 m, and A to 0.
    """
    # A box that reaches beyond a wall by more than the tolerance is left there, to be refused.
    first = np.where(low >= -tolerance, low.clip(0), low)
    last = np.where(high <= room + tolerance, room - edges, np.inf)
    for box, others in rows:
        first[box] = (first[others] + edges[others]).max(initial=first[box])
    for box, others in rows[::-1]:
        last[others] = np.minimum(last[others], last[box] - edges[others])
    return np.minimum(first, last)


def uncarried(load: Load) -> np.ndarray:
    """The boxes whose centre of mass no support carries, (k,) int64: left alone, they tip.

    A centre is carried if the box stands on the floor, or if it lies within the smallest convex
    shape around the faces that the box stands on, each made smaller by ``SLACK`` as in the physics.
    """
    low, high = load.positions - load.sizes / 2, load.positions + load.sizes / 2
    tipping = []
    for box in np.flatnonzero(low[:, 2] > CONTACT_TOLERANCE).tolist():
        below, centre = load.contacts.of(BELOW, box), load.positions[box]
        start = np.maximum(low[below], low[box]) - centre + SLACK
        end = np.minimum(high[below], high[box]) - centre - SLACK
        x, y = (np.stack([start[:, axis], end[:, axis]]) for axis in (0, 1))
        # The centre lies within them if, seen from it, no two neighbouring corners are half a turn
        # or more apart.
        angles = np.sort(np.arctan2(y[:, np.newaxis], x).ravel())
        if not below.size or np.diff(angles, append=angles[0] + 2 * np.pi).max() >= np.pi:
            tipping.append(box)
    return np.array(tipping, np.int64)
