"""The boxes of one container: their places, sizes and contacts.

Overlaps and contacts are those of axis-aligned boxes, given by their lower and upper corners,
``low`` and ``high``, (n, 3) float64 in m.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from unload import task
from unload.support import checks
from unload.support.compiled import compiled

# Edges are at least this long (m), because physics makes boxes 1 mm narrower (``bullet.GAP``).
SMALLEST_EDGE = 0.002
CONTACT_TOLERANCE = 1e-4  # m, faces this close touch
OVERLAP = 1e-6  # m, boxes that share more than this on each axis overlap
ABOVE, BELOW, BESIDE = range(3)  # kinds of contact


class Contacts(NamedTuple):
    """Lists of touching boxes, one after the other in one array.

    The boxes above (0), below (1) or beside (2) box ``b`` are
    ``boxes[starts[kind, b] : starts[kind, b + 1]]``.

    Attributes:
        starts: (3, n + 1) int32.
        boxes: (m,) int32.
    """

    starts: np.ndarray
    boxes: np.ndarray

    def of(self, kind: int, box: int) -> np.ndarray:
        """The boxes that touch ``box``, (k,) int32."""
        return self.boxes[self.starts[kind, box] : self.starts[kind, box + 1]]


class BoxError(ValueError):
    """Boxes that no load can hold.

    Attributes:
        boxes: their numbers.
        problem: what is wrong, of the first one in numbers, and what was expected.
    """

    def __init__(self, boxes: Sequence[int] | np.ndarray, problem: str) -> None:
        super().__init__(boxes, problem)
        self.boxes, self.problem = [int(box) for box in boxes], problem

    def __str__(self) -> str:
        return f"{'box' if len(self.boxes) == 1 else 'boxes'} {self.boxes}: {self.problem}"


@dataclass(frozen=True, repr=False, eq=False)  # arrays have no single truth value
class Load:
    """The boxes of one container, before anything is unloaded.

    Attributes:
        positions: (n, 3) float64, centre of each box in m, inside the container.
        sizes: (n, 3) float64, edge lengths along x, y and z in m, at least 0.002.
        packages: (n,) int64, package number (0–12 in the paper's loads), for the colours of views.
        walls: (n,) int64, number of the item wall, 0 at the rear; a label, too.
        ids: (n,) str, what a packing list calls the boxes; None without a list.
        contacts: which boxes touch, computed from positions and sizes.

    Raises:
        TypeError: a field's dtype is not numeric.
        ValueError: a field's shape or a value is wrong, or an id is given twice.
        BoxError: a ValueError, too: an edge is too short, a box sticks out of the container, or
            two boxes overlap by more than 1 µm.
    """

    positions: np.ndarray
    sizes: np.ndarray
    packages: np.ndarray
    walls: np.ndarray
    ids: np.ndarray | None = None
    contacts: Contacts = field(init=False)

    def __post_init__(self) -> None:
        positions = checks.finite_array("positions", self.positions, (None, 3))
        count = len(positions)
        if count == 0:
            raise ValueError("positions is empty; expected at least one box")
        sizes = checks.finite_array("sizes", self.sizes, (count, 3))
        labels = {}
        for name in ("packages", "walls"):
            labels[name] = checks.integer_array(name, getattr(self, name), (count,))
            if (labels[name] < 0).any():
                raise ValueError(f"{name} holds {labels[name].min()}; expected numbers >= 0")
        if self.ids is not None:
            labels["ids"] = np.array(self.ids, dtype=str)
            if labels["ids"].shape != (count,) or len(np.unique(labels["ids"])) < count:
                raise ValueError(f"ids is {self.ids!r}; expected {count} different names")

        # Where there are no thin boxes and none outside, contacts finds those that overlap.
        low, high = positions - sizes / 2, positions + sizes / 2
        thin = np.flatnonzero(sizes.min(axis=1) < SMALLEST_EDGE)
        if thin.size:
            raise BoxError(thin, f"edges of {sizes[thin[0]]} m; expected >= {SMALLEST_EDGE} m")
        beyond = (low < -OVERLAP) | (high > task.CONTAINER + OVERLAP)
        outside = np.flatnonzero(beyond.any(axis=1))
        if outside.size:
            place = f"from {low[outside[0]]} to {high[outside[0]]} m"
            inside = f"inside the container, [0 0 0] to {task.CONTAINER} m"
            raise BoxError(outside, f"reaches {place}; expected it {inside}")
        touching = contacts(low, high)

        # Nobody may change the arrays later, because contacts would no longer be theirs.
        fields = {"positions": positions, "sizes": sizes, **labels}
        for array in (*fields.values(), *touching):
            array.setflags(write=False)
        for name, value in {**fields, "contacts": touching}.items():
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.positions)

    def __repr__(self) -> str:
        return f"Load({len(self)} items in {len(np.unique(self.walls))} walls)"


def check_load(load: object, name: str = "load") -> None:
    """Raise TypeError unless ``load`` is a ``Load``, which holds at least one item."""
    if not isinstance(load, Load):
        raise TypeError(f"{name} is {load!r}; expected an unload.Load")


def check_stacked(load: Load, name: str = "load") -> None:
    """Raise unless ``load`` is a ``Load`` whose boxes stand on the floor or on each other.

    Where there is a gap between two boxes, the upper one would not hold the lower one down.

    Raises:
        TypeError: it is no ``Load``.
        BoxError: boxes float.
    """
    check_load(load, name)
    low = load.positions - load.sizes / 2
    aloft = np.flatnonzero(floating(low, load.contacts))
    if aloft.size:
        raise BoxError(
            aloft,
            f"floats in {name}, its lower face at {low[aloft[0], 2]:.6g} m; expected it, within "
            f"{CONTACT_TOLERANCE} m, on the floor or on another box",
        )


def check_stack(stack: object) -> None:
    """Raise TypeError unless ``stack`` is callable, as what makes a load must be."""
    if not callable(stack):
        raise TypeError(f"stack is {stack!r}; expected a function from a Generator to a Load")


def slabs(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Number groups of intervals between which there is no overlap, such as item walls.

    Args:
        low, high: (n,) start and end of each interval, for example along x.

    Returns:
        (n,) int64, each interval's group, 0 being the lowest.
    """
    order = np.argsort(low, kind="stable")
    reach = np.maximum.accumulate(high[order])
    groups = np.empty(len(low), np.int64)
    groups[order] = np.append(0, np.cumsum(low[order][1:] >= reach[:-1]))
    return groups


def contacts(low: np.ndarray, high: np.ndarray) -> Contacts:
    """Find which boxes stand on each other, and which stand side by side.

    Boxes touch only where they share a stretch of depth, and of height or width.

    Args:
        low, high: (n, 3) float64, corners in m.

    Raises:
        BoxError: two boxes overlap.
    """
    groups = slabs(low[:, 0] + OVERLAP, high[:, 0])
    left_to_right = np.lexsort((low[:, 1], groups))  # within each slab
    found, *pair = _find(low, high, left_to_right, np.cumsum(np.bincount(groups)))
    if pair[0] != pair[1]:
        shared = (np.minimum(*high[pair]) - np.maximum(*low[pair])).min()
        raise BoxError(sorted(pair), f"overlap by {shared:.2g} m; expected at most {OVERLAP}")
    return Contacts(*_lists(found, len(low)))


def floating(low: np.ndarray, touching: Contacts) -> np.ndarray:
    """(n,) bool, which boxes stand neither on the floor nor on another box."""
    return (np.diff(touching.starts[BELOW]) == 0) & (low[:, 2] > CONTACT_TOLERANCE)


@compiled
def _find(low, high, order, ends):
    """Rows (kind, box, box that touches it), and two boxes that overlap; 0 twice if none do.

    Args:
        low, high: corners.
        order: (n,) the boxes, slab by slab, from left to right in each.
        ends: where in ``order`` each slab ends.
    """
    count, start = 0, 0
    found = np.empty((8 * len(order) + 4, 3), np.int32)
    # One array each: what is read next is near what was read last.
    x0, y0, z0 = _columns(low, order)
    x1, y1, z1 = _columns(high, order)
    # Boxes of different slabs share no depth. Within a slab, a sweep from left to right compares a
    # box with those only that begin before it ends.
    for end in ends:
        for i in range(start, end):
            if count + 2 * (end - i) > len(found):
                found = np.concatenate((found, np.empty_like(found)))
            limit = y1[i] + CONTACT_TOLERANCE
            for j in range(i + 1, end):
                if y0[j] > limit:
                    break  # j begins to the right of i, and so do all further ones
                # Lengths of the stretches that both share; below 0 the gap between them.
                upwards = min(z1[i], z1[j]) - max(z0[i], z0[j])
                if upwards < -CONTACT_TOLERANCE:
                    continue
                across = min(y1[i], y1[j]) - y0[j]
                along = min(x1[i], x1[j]) - max(x0[i], x0[j])
                if min(across, upwards, along) > OVERLAP:
                    return found[:count], order[i], order[j]

                # They touch if they share depth, and besides either width or height.
                if max(across, upwards) <= CONTACT_TOLERANCE or along <= CONTACT_TOLERANCE:
                    continue
                one, other = BESIDE, BESIDE  # what j is to i, and i to j
                if across > CONTACT_TOLERANCE:
                    one, other = (ABOVE, BELOW) if z0[j] > z0[i] else (BELOW, ABOVE)

                # Each pair is written down twice, because each box has a list of its own.
                found[count, 0], found[count, 1], found[count, 2] = one, order[i], order[j]
                count += 1
                found[count, 0], found[count, 1], found[count, 2] = other, order[j], order[i]
                count += 1
        start = end
    return found[:count], 0, 0


@compiled
def _columns(corners, order):
    """x, y and z of corners in this order."""
    x, y, z = np.empty(len(order)), np.empty(len(order)), np.empty(len(order))
    for i, box in enumerate(order):
        x[i], y[i], z[i] = corners[box]
    return x, y, z


@compiled
def _lists(found, count):
    """``starts`` and ``boxes`` of ``Contacts``."""
    starts = np.zeros((3, count + 1), np.int32)
    for row in range(len(found)):
        starts[found[row, 0], found[row, 1]] += 1
    total = 0
    for kind in range(3):  # from the number of a box's contacts to the end of its list
        for box in range(count + 1):
            total += starts[kind, box]
            starts[kind, box] = total
    boxes = np.empty(total, np.int32)
    for row in range(len(found)):  # fills each list from its end, which leaves its start
        kind, box = found[row, 0], found[row, 1]
        starts[kind, box] -= 1
        boxes[starts[kind, box]] = found[row, 2]
    return starts, boxes
