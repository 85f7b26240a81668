"""The boxes of one container: their places, sizes and contacts.

A ``Load`` holds centres and sizes. Overlaps and contacts are computed from lower and upper corners,
``low`` and ``high``, (n, 3) float64 in m.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from unload import task
from unload.support import checks
from unload.support.compiled import compiled

# Edges are at least this long (m), because physics makes boxes 1 mm narrower (``bullet.GAP``).
_SMALLEST_EDGE = 0.002
CONTACT_TOLERANCE = 1e-4  # m, faces this close touch
LARGEST_TOLERANCE = 0.1  # m
_SMALLEST_FACE = 1e-6  # m², a smaller part of a face counts as none
OVERLAP = 1e-6  # m, boxes that share more than this on each axis overlap
ABOVE, BELOW, BESIDE = range(3)  # kinds of contact


class Contacts(NamedTuple):
    """Lists of touching boxes, one after the other in one array.

    The boxes above (0), below (1) or beside (2) box ``b`` are
    ``links[starts[kind, b] : starts[kind, b + 1]]``.

    Attributes:
        starts: (3, n + 1) int32.
        links: (m,) int32, numbers of boxes.
    """

    starts: np.ndarray
    links: np.ndarray

    def of(self, kind: int, box: int) -> np.ndarray:
        """The boxes that touch ``box``, (k,) int32."""
        return self.links[self.starts[kind, box] : self.starts[kind, box + 1]]

    def pairs(self, kind: int) -> tuple[np.ndarray, np.ndarray]:
        """All pairs of a box and one that touches it, (k,) int each."""
        starts = self.starts[kind]
        boxes = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
        return boxes, self.links[starts[0] : starts[-1]]


class BoxError(ValueError):
    """Boxes that no load can hold.

    Attributes:
        boxes: their numbers.
        problem: of the first of them.
        misplaced: whether their places are the problem, and not an edge or an id.
    """

    def __init__(
        self, boxes: Sequence[int] | np.ndarray, problem: str, misplaced: bool = True
    ) -> None:
        super().__init__(boxes, problem, misplaced)
        self.boxes, self.problem = [int(box) for box in boxes], problem
        self.misplaced = misplaced

    def __str__(self) -> str:
        return f"{'box' if len(self.boxes) == 1 else 'boxes'} {self.boxes}: {self.problem}"


@dataclass(frozen=True, repr=False, eq=False)  # arrays have no single truth value
class Load:
    """The boxes of one container, before anything is unloaded.

    Attributes:
        positions: (n, 3) float64, centre of each box in m, inside the container.
        sizes: (n, 3) float64, edge lengths along x, y and z in m, at least 0.002.
        packages: (n,) int64, package number (0–12 in the paper's loads), for the colours of views;
            if not given, boxes of equal size are of one package.
        walls: (n,) int64, number of the item wall, 0 at the rear; a label, too. If not given,
            boxes that share a stretch of depth are of one wall.
        ids: (n,) str, what a packing list calls the boxes; None without a list.
        container: (3,) float64, inner length, width and height in m; the paper's if not given.
        extras: name → (n,) array, what a packing list says besides; empty if not given.
        contact_tolerance: largest vertical gap in m, 0.0001 to 0.1, across which a box still
            counts as lying on another one. So a box on two supports of slightly different measured
            heights touches both.
        contacts: which boxes touch, computed from positions and sizes.

    Raises:
        TypeError: a field's dtype is not numeric.
        ValueError: a field's shape or a value is wrong.
        BoxError: a ValueError, too: an edge is too short, a box sticks out of the container, two
            boxes overlap by more than 1 µm, or have the same id.
    """

    positions: np.ndarray
    sizes: np.ndarray
    packages: np.ndarray = None
    walls: np.ndarray = None
    ids: np.ndarray | None = None
    container: np.ndarray = None
    extras: Mapping[str, np.ndarray] = None
    contact_tolerance: float = CONTACT_TOLERANCE
    contacts: Contacts = field(init=False)

    def __post_init__(self) -> None:
        positions = checks.finite_array("positions", self.positions, (None, 3))
        count = len(positions)
        if count == 0:
            raise ValueError("positions is empty; expected at least one box")
        sizes = checks.finite_array("sizes", self.sizes, (count, 3))
        container = task.CONTAINER if self.container is None else self.container
        container = checks.finite_array("container", np.array(container, np.float64), (3,))
        low, high = positions - sizes / 2, positions + sizes / 2
        tolerance = checks.real(
            "contact_tolerance", self.contact_tolerance, CONTACT_TOLERANCE, LARGEST_TOLERANCE
        )

        # Labels serve views and lists; what moves does not depend on them.
        labels = {"packages": self.packages, "walls": self.walls}
        if labels["packages"] is None:
            edges = np.rint(sizes / OVERLAP)
            labels["packages"] = np.unique(edges, axis=0, return_inverse=True)[1].reshape(-1)
        if labels["walls"] is None:
            labels["walls"] = slabs(low[:, 0] + OVERLAP, high[:, 0])
        for name, label in labels.items():
            labels[name] = checks.integer_array(name, label, (count,))
            if (labels[name] < 0).any():
                raise ValueError(f"{name} holds {labels[name].min()}; expected numbers >= 0")
        checks.entries("extras", given := {} if self.extras is None else self.extras, ())
        extras = {name: np.array(values) for name, values in given.items()}
        for name, values in extras.items():
            checks.shaped(f"extras[{name!r}]", values, (count,))
        if self.ids is not None:
            labels["ids"] = np.array(self.ids, dtype=str)
            checks.shaped("ids", labels["ids"], (count,))
            _, which, times = np.unique(labels["ids"], return_inverse=True, return_counts=True)
            if (repeated := np.flatnonzero(times[which] > 1)).size:
                raise BoxError(repeated, "the same id; expected one for each box", misplaced=False)

        # Thin boxes and those outside are refused first, then by _find_contacts those that overlap.
        thin = np.flatnonzero(sizes.min(axis=1) < _SMALLEST_EDGE)
        if thin.size:
            found = f"edges of {sizes[thin[0]]} m; expected >= {_SMALLEST_EDGE} m"
            raise BoxError(thin, found, misplaced=False)
        beyond = (low < -OVERLAP) | (high > container + OVERLAP)
        outside = np.flatnonzero(beyond.any(axis=1))
        if outside.size:
            place = f"from {low[outside[0]]} to {high[outside[0]]} m"
            inside = f"inside the container, [0 0 0] to {container} m"
            raise BoxError(outside, f"reaches {place}; expected it {inside}")
        contacts = _find_contacts(low, high, tolerance)

        # The arrays are read-only from here on, because the contacts were computed from them.
        fields = {"positions": positions, "sizes": sizes, "container": container, **labels}
        for array in (*fields.values(), *extras.values(), *contacts):
            array.setflags(write=False)
        rest = {"extras": extras, "contact_tolerance": tolerance, "contacts": contacts}
        for name, value in {**fields, **rest}.items():
            object.__setattr__(self, name, value)

    def behind(self, present: np.ndarray) -> np.ndarray:
        """Which boxes have one of the present ones in front of them, (n,) bool.

        In front of a box is what stands nearer to the door and overlaps it in y and z.
        """
        box, front = self.fronts
        return np.bincount(box[present[front]], minlength=len(self)) > 0

    def covered(self, present: np.ndarray) -> np.ndarray:
        """Which boxes have one of the present ones on or over them, (n,) bool."""
        lower, upper = self.covers
        return np.bincount(lower[present[upper]], minlength=len(self)) > 0

    @cached_property
    def covers(self) -> tuple[np.ndarray, np.ndarray]:
        """All pairs of a box and one above it, (k,) int each, whether it rests there or hangs."""
        return self._pairs(2)

    @cached_property
    def fronts(self) -> tuple[np.ndarray, np.ndarray]:
        """All pairs of a box and one in front of it, (k,) int each."""
        return self._pairs(0)

    def _pairs(self, axis: int) -> tuple[np.ndarray, np.ndarray]:
        """Pairs of a box and one farther along ``axis`` that overlaps it on both other axes."""
        centre = self.positions[:, axis]
        # One row for each of the other axes: NumPy is fast along long rows.
        low, high = self.positions - self.sizes / 2, self.positions + self.sizes / 2
        low, high = (np.delete(corner, axis, axis=1).T.copy() for corner in (low, high))
        pairs = []
        for box in range(len(self)):
            shared = np.minimum(high[:, [box]], high) - np.maximum(low[:, [box]], low)
            across = (shared > OVERLAP).all(axis=0)
            pairs.append(np.flatnonzero(across & (centre > centre[box])))
        return np.repeat(np.arange(len(self)), [*map(len, pairs)]), np.concatenate(pairs)

    def __deepcopy__(self, memo: dict) -> "Load":
        return self  # nothing of it changes

    def __len__(self) -> int:
        return len(self.positions)

    def __repr__(self) -> str:
        return f"Load({len(self)} items in {len(np.unique(self.walls))} walls)"


def check_load(load: object, name: str = "load") -> None:
    """Raise TypeError unless ``load`` is a ``Load``, which holds at least one item."""
    checks.instance(name, load, Load, "an unload.Load")


def check_supported(load: Load, name: str = "load") -> None:
    """Raise unless ``load`` is a ``Load`` whose boxes stand on the floor or on each other.

    A box over a gap would not press on the one below.
    """
    check_load(load, name)
    bottom = load.positions[:, 2] - load.sizes[:, 2] / 2
    unsupported = np.diff(load.contacts.starts[BELOW]) == 0
    aloft = np.flatnonzero(unsupported & (bottom > CONTACT_TOLERANCE))
    if aloft.size:
        wanted = f"expected it on the floor, or within {load.contact_tolerance} m on another box"
        place = f"floats in {name}, its lower face at {bottom[aloft[0]]:.6g} m"
        raise BoxError(aloft, f"{place}; {wanted}")


def check_no_overhang(load: Load) -> None:
    """Raise BoxError where a box hangs over another one on which it does not rest, directly or not.

    A lift that follows contacts alone would pull the lower one through the upper one.
    """
    low, high = load.positions - load.sizes / 2, load.positions + load.sizes / 2
    upper, lower = load.contacts.pairs(BELOW)
    shared = np.minimum(high[upper], high[lower]) - np.maximum(low[upper], low[lower])
    held = np.bincount(upper, shared[:, 0] * shared[:, 1], len(load))

    # What lies on others with its whole face hangs over nothing, as all boxes of the paper's loads.
    aloft = low[:, 2] > CONTACT_TOLERANCE
    partly_free = load.sizes[:, 0] * load.sizes[:, 1] - held > _SMALLEST_FACE
    for box in np.flatnonzero(aloft & partly_free).tolist():
        rests, below = np.zeros(len(load), bool), [box]
        while below:
            others = load.contacts.of(BELOW, below.pop())
            below += others[~rests[others]].tolist()
            rests[others] = True
        shared = np.minimum(high[box], high) - np.maximum(low[box], low)
        # What shares less than a contact's tolerance with it is not pulled into it, because physics
        # makes boxes narrower (``bullet.GAP``).
        under = (shared[:, :2] > CONTACT_TOLERANCE).all(axis=1) & (
            load.positions[:, 2] < load.positions[box, 2]
        )
        if (free := np.flatnonzero(under & ~rests)).size:
            names = [other if load.ids is None else load.ids[other] for other in (box, free[0])]
            wanted = "expected it to rest there, or physics='full', which simulates all boxes"
            raise BoxError([box], f"{names[0]} hangs over {names[1]}; {wanted}")


def check_stack(stack: object) -> None:
    """Raise TypeError unless ``stack`` is callable, as what makes a load must be."""
    if not callable(stack):
        raise TypeError(f"stack is {stack!r}; expected a function such as lambda rng: load")


def slabs(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """The group of each interval, (n,) int64 from 0; those of different groups do not overlap."""
    order = np.argsort(low, kind="stable")
    reach = np.maximum.accumulate(high[order])
    groups = np.empty(len(low), np.int64)
    groups[order] = np.append(0, np.cumsum(low[order][1:] >= reach[:-1]))
    return groups


def _find_contacts(low: np.ndarray, high: np.ndarray, tolerance: float) -> Contacts:
    """Find which boxes stand on each other, and which stand side by side; BoxError if two overlap.

    Boxes touch only where they share a stretch of depth, and of height or width. Between one and
    the next one above it there may be a gap of ``tolerance``, in m.
    """
    groups = slabs(low[:, 0] + OVERLAP, high[:, 0])
    left_to_right = np.lexsort((low[:, 1], groups))  # within each slab
    # One row per axis: what is read next is near what was read last.
    corners = (np.ascontiguousarray(corner[left_to_right].T) for corner in (low, high))
    rows, *pair = _find(*corners, left_to_right, np.cumsum(np.bincount(groups)), tolerance)
    if pair[0] != pair[1]:
        shared = (np.minimum(*high[pair]) - np.maximum(*low[pair])).min()
        raise BoxError(sorted(pair), f"overlap by {shared:.2g} m; expected none")
    return Contacts(*_lists(rows, len(low)))


@compiled(lazy=True)
def _find(low, high, order, ends, tolerance):
    """Rows (kind, box, box that touches it), and two boxes that overlap; 0 twice if none do.

    ``order`` is slab by slab, from left to right in each, and ``ends`` where in it each slab ends;
    so are the corners ``low`` and ``high``, (3, n).
    """
    count, start = 0, 0
    rows = np.empty((8 * len(order), 3), np.int32)
    (x0, y0, z0), (x1, y1, z1) = (low[0], low[1], low[2]), (high[0], high[1], high[2])
    # Boxes of different slabs share no depth. Within a slab, a sweep from left to right compares a
    # box with those only that begin before it ends.
    for end in ends:
        for i in range(start, end):
            if count + 2 * (end - i) > len(rows):
                rows = np.concatenate((rows, np.empty_like(rows)))
            limit = y1[i] + CONTACT_TOLERANCE
            for j in range(i + 1, end):
                if y0[j] > limit:
                    break  # j begins to the right of i, and so do all further ones
                # Lengths of the stretches that both share; below 0 the gap between them.
                overlap_z = min(z1[i], z1[j]) - max(z0[i], z0[j])
                if overlap_z < -tolerance:
                    continue
                overlap_y = min(y1[i], y1[j]) - y0[j]
                overlap_x = min(x1[i], x1[j]) - max(x0[i], x0[j])
                if min(overlap_y, overlap_z, overlap_x) > OVERLAP:
                    return rows[:count], order[i], order[j]

                # They touch if they share depth, and besides either width or height: not where only
                # edges meet, nor front to rear, since walls do not hold each other.
                if max(overlap_y, overlap_z) <= CONTACT_TOLERANCE or overlap_x <= CONTACT_TOLERANCE:
                    continue
                one, other = BESIDE, BESIDE  # what j is to i, and i to j
                if overlap_y > CONTACT_TOLERANCE:
                    one, other = (ABOVE, BELOW) if z0[j] > z0[i] else (BELOW, ABOVE)

                # Each pair is written down twice, because each box has a list of its own.
                rows[count, 0], rows[count, 1], rows[count, 2] = one, order[i], order[j]
                count += 1
                rows[count, 0], rows[count, 1], rows[count, 2] = other, order[j], order[i]
                count += 1
        start = end
    return rows[:count], 0, 0


@compiled(lazy=True)
def _lists(rows, count):
    """``starts`` and ``links`` of ``Contacts``: a counting sort of the rows by kind and box."""
    starts = np.zeros((3, count + 1), np.int32)
    for row in range(len(rows)):
        starts[rows[row, 0], rows[row, 1]] += 1
    total = 0
    for kind in range(3):  # the number of a box's contacts becomes where its list ends
        for box in range(count + 1):
            total += starts[kind, box]
            starts[kind, box] = total
    links = np.empty(total, np.int32)
    for row in range(len(rows)):  # lists are filled backwards, so that in the end they start there
        kind, box = rows[row, 0], rows[row, 1]
        starts[kind, box] -= 1
        links[starts[kind, box]] = rows[row, 2]
    return starts, links
