"""The situation of a box: the boxes that decide whether it can be lifted.

A box is held down by what rests on it, directly or over others. It may rub against its
neighbours in the same wall, and what lies on it slides or tips off only where they leave room.
All else in the container is left out. The search is compiled, for ``unload.fast`` as well.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from unload.load.boxes import ABOVE, BELOW, BESIDE, CONTACT_TOLERANCE, Load
from unload.support.compiled import compiled

RESOLUTION = 1e-6  # m, to which a situation is rounded, so that equal ones are equal in bits


@dataclass(frozen=True, eq=False)  # equal situations have equal keys
class Situation:
    """One box and what decides its lift, relative to it, in whole micrometres.

    Attributes:
        boxes: (m, 6) int32, centre relative to the chosen box and edge lengths, both
            along x, y, z. Row 0 is the chosen box, the next are those on top of it.
        dynamic: how many of the rows can move: the chosen box and all on top of it.
        floor: z of the floor if the chosen box stands on it, else None.
        sides: y of the container's side walls that a box which can move touches.
    """

    boxes: np.ndarray
    dynamic: int
    floor: int | None
    sides: tuple[int, ...]

    @cached_property
    def key(self) -> bytes:
        """Equal for equal situations: int32 words, all lengths in micrometres.

        They are how many boxes can move, 1 if there is a floor and else 0, its z if there is one, y
        of each side wall, and the six numbers of each box. For example, a box of 0.6 × 0.5 × 0.4 m
        that stands alone on the floor, at the left side wall, has::

            1, 1, -200000, -250000, 0, 0, 0, 600000, 500000, 400000
        """
        floor = () if self.floor is None else (self.floor,)
        head = np.array([self.dynamic, len(floor), *floor, *self.sides], dtype=np.int32)
        return head.tobytes() + self.boxes.tobytes()

    @cached_property
    def digest(self) -> np.uint64:
        """Equal for equal situations, and hardly ever for others: see ``digest_of``."""
        return np.uint64(digest_of(np.frombuffer(self.key, np.int32)))

    @property
    def on_top(self) -> int:
        """Number of boxes that rest on the chosen one, directly or over others."""
        return self.dynamic - 1

    def floor_and_sides(self) -> list[tuple[tuple[float, float, float], tuple[int, int, int]]]:
        """Fixed boxes for the floor and the side walls: centre and edge lengths of each, in m."""
        fixed = []
        if self.floor is not None:
            fixed.append(((0.0, 0.0, self.floor * RESOLUTION - 0.5), (9, 9, 1)))
        for side in self.sides:
            outside = side * RESOLUTION + (0.5 if side > 0 else -0.5)
            fixed.append(((0.0, outside, 0.0), (9, 1, 9)))
        return fixed


class Surroundings:
    """The situations of all boxes of a load, while it is unloaded.

    The load knows which boxes touch; picks only take boxes away: ``present``, (n,) bool and owned
    by the caller, is False for those.
    """

    def __init__(self, load: Load, present: np.ndarray) -> None:
        self.load, self.present = load, present
        self._geometry = np.hstack([load.positions, load.sizes])
        # Copies, which may be written: for arrays that may not be, numba would compile twice.
        self._starts, self._links = map(np.array, load.contacts)

    def on_top(self, item: int) -> list[int]:
        """The present boxes that rest on ``item``, directly or over others, in index order."""
        members = np.empty(len(self.load), np.int32)
        contacts = self._starts, self._links, self.present
        count = find_movers(*contacts, item, members, len(members))
        return sorted(members[1:count].tolist())

    def situation(self, item: int) -> Situation:
        """Return the situation of ``item``: the boxes that decide its lift."""
        contacts = self._starts, self._links, self.present
        return situation_in(*contacts, self._geometry, self.load.container[1], item)


@compiled
def key_length(boxes):
    """The greatest number of words in the key of a situation of so many boxes, with two sides."""
    return 5 + 6 * boxes


@compiled
def find_movers(starts, links, present, item, members, most):
    """How many boxes a lift moves: the item and all on top of it, at most ``most``.

    Args:
        starts, links: see ``Contacts``.
        present: (n,) bool, the boxes that are there.
        item: its number.
        members: (n,) int32; the boxes found are written to its start, the item first.
        most: after so many the search ends; at least 2.
    """
    members[0], dynamic, done = item, 1, 0
    while done < dynamic:
        box = members[done]
        done += 1
        for link in range(starts[ABOVE, box], starts[ABOVE, box + 1]):
            if present[links[link]] and not _holds(members, dynamic, links[link]):
                members[dynamic] = links[link]
                dynamic += 1
                if dynamic >= most:
                    return dynamic
    return dynamic


@compiled
def find_touching(starts, links, present, members, dynamic):
    """How many boxes decide a lift: those that it moves, and what they stand on or may rub against.

    Args:
        starts, links, present: as for ``find_movers``.
        members: (n,) int32, begins with the ``dynamic`` boxes of ``find_movers``. Those on top are
            sorted here, and the boxes found are written behind them, sorted, too.
        dynamic: their number.
    """
    for end in range(1, dynamic):  # numba's own sort takes a second more to compile
        _insert(members, 1, end, members[end])
    count = dynamic
    for mover in range(dynamic):
        box = members[mover]
        for kind in (BELOW, BESIDE):
            for link in range(starts[kind, box], starts[kind, box + 1]):
                if present[links[link]] and not _holds(members, count, links[link]):
                    count = _insert(members, dynamic, count, links[link])
    return count


@compiled
def write_key(geometry, right, members, dynamic, key):
    """Write the words of ``Situation.key``; return how many there are.

    Args:
        geometry: (n, 6) float64, centre and edge lengths of each box in m.
        right: y of the right side wall in m.
        members: (k,) int32, the boxes that ``find_touching`` found, no more.
        dynamic: how many of them a lift moves.
        key: int32, written; ``key_length`` says how much room it needs.
    """
    # The floor matters to the chosen box alone, a side wall to each box that moves.
    lowest, highest = np.inf, -np.inf
    for mover in range(dynamic):
        y, width = geometry[members[mover], 1], geometry[members[mover], 4]
        lowest, highest = min(lowest, y - width / 2), max(highest, y + width / 2)
    item = members[0]
    x, y, z = geometry[item, 0], geometry[item, 1], geometry[item, 2]
    key[0], key[1], words = dynamic, 0, 2
    if z - geometry[item, 5] / 2 <= CONTACT_TOLERANCE:
        key[1], key[2], words = 1, _micrometres(-z), 3
    if lowest <= CONTACT_TOLERANCE:
        key[words] = _micrometres(-y)
        words += 1
    if highest >= right - CONTACT_TOLERANCE:
        key[words] = _micrometres(right - y)
        words += 1

    # Relative to the item before rounding: equal situations are equal wherever they are.
    for box in members:
        for axis, origin in enumerate((x, y, z)):
            key[words + axis] = _micrometres(geometry[box, axis] - origin)
            key[words + 3 + axis] = _micrometres(geometry[box, 3 + axis])
        words += 6
    return words


def situation_in(
    starts: np.ndarray,
    links: np.ndarray,
    present: np.ndarray,
    geometry: np.ndarray,
    right: float,
    item: int,
) -> Situation:
    """The situation of ``item`` in a container, see ``find_movers`` and ``write_key``."""
    members = np.empty(len(present), np.int32)
    key = np.empty(key_length(len(present)), np.int32)
    dynamic = find_movers(starts, links, present, item, members, len(members))
    count = find_touching(starts, links, present, members, dynamic)
    words = write_key(geometry, right, members[:count], dynamic, key)
    key = key[:words].copy()
    sides, boxes = parts_of_key(key)
    return Situation(
        boxes=key[boxes:].reshape(-1, 6),
        dynamic=int(key[0]),
        floor=int(key[2]) if key[1] else None,
        sides=tuple(key[sides:boxes].tolist()),
    )


@compiled
def parts_of_key(key):
    """Where in a situation's key its side walls begin, and where its boxes, see ``Situation.key``.

    Each box takes six words, and there are two side walls at most. So the number of words after the
    floor, divided by six, leaves the number of side walls as its remainder.
    """
    sides = 2 + key[1]
    return sides, sides + (len(key) - sides) % 6


@compiled
def _micrometres(length):
    return np.int32(np.rint(length / RESOLUTION))


@compiled
def _holds(members, end, box):
    for i in range(end):
        if members[i] == box:
            return True
    return False


@compiled
def _insert(members, first, end, box):
    """Put a box into its place among the sorted ``members[first:end]``; the new end."""
    place = end
    while place > first and members[place - 1] > box:
        members[place] = members[place - 1]
        place -= 1
    members[place] = box
    return end + 1


@compiled
def digest_of(words):
    """The digest of a situation's key, (k,) int32: never 0."""
    digest = np.uint64(len(words))
    for word in words:  # a multiplication and a shift mix all bits
        digest = (digest ^ np.uint64(np.uint32(word))) * np.uint64(0x9E3779B97F4A7C15)
        digest ^= digest >> np.uint64(29)
    return max(digest, np.uint64(1))
