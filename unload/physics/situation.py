"""The situation of a box: the boxes that decide whether it can be lifted.

A box is held down by what rests on it, directly or over others. It may rub against its
neighbours in the same wall, and it can tip aside only what its surroundings let fall.
All else in the container is left out.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from unload import task
from unload.load.boxes import ABOVE, BELOW, BESIDE, CONTACT_TOLERANCE, Load

PULL = task.PICK_FORCE / task.MASS  # N per kg
USUAL = round(task.MASS * 1000)  # g
RESOLUTION = 1e-6  # m, to which a situation is rounded, so that equal ones are equal in bits


@dataclass(frozen=True, eq=False)  # equal situations have equal keys
class Situation:
    """The surroundings of one box, relative to it, in whole micrometres.

    Attributes:
        boxes: (m, 6) int32, centre relative to the chosen box and edge lengths, both
            along x, y, z. Row 0 is the chosen box, the next are those on top of it.
        dynamic: how many of the rows can move: the chosen box and all on top of it.
        floor: z of the floor if the chosen box stands on it, else None.
        sides: y of the container's side walls that a box of the situation touches.
        pull: what else decides: the force in mN, and the masses of the dynamic boxes in g; empty
            for those of the task, 20 N and 1 kg each.
    """

    boxes: np.ndarray
    dynamic: int
    floor: int | None
    sides: tuple[int, ...]
    pull: tuple[int, ...] = ()

    @cached_property
    def key(self) -> bytes:
        """Equal for equal situations: its integers in a row, to look a lift up by."""
        floor = () if self.floor is None else (self.floor,)
        head = np.array([self.dynamic, len(floor), *floor, *self.sides], dtype=np.int32)
        return head.tobytes() + self.boxes.tobytes() + np.array(self.pull, np.int32).tobytes()

    @property
    def force(self) -> float:
        """N, with which the chosen box is pulled."""
        return self.pull[0] / 1000 if self.pull else task.PICK_FORCE

    @property
    def masses(self) -> list[float]:
        """Of the dynamic boxes in kg."""
        return [gram / 1000 for gram in self.pull[1:]] or [task.MASS] * self.dynamic

    @property
    def on_top(self) -> int:
        """Number of boxes that rest on the chosen one, directly or over others."""
        return self.dynamic - 1


class Surroundings:
    """The situations of all boxes of a load, while it is unloaded.

    The load knows which boxes touch; picks only take boxes away: ``present``, (n,) bool and owned
    by the caller, is False for those. ``force`` is the strongest pull, see ``Physics``.
    """

    def __init__(self, load: Load, present: np.ndarray, force: float = task.PICK_FORCE) -> None:
        self.load, self.present = load, present
        self._grams = np.rint(load.masses * 1000).astype(np.int64)
        self._pulls = np.minimum(self._grams * PULL, force * 1000).astype(np.int64)  # mN
        self._geometry = np.hstack([load.positions, load.sizes])
        self._low = load.positions - load.sizes / 2
        self._high = load.positions + load.sizes / 2

    def on_top(self, item: int) -> list[int]:
        """The present boxes that rest on ``item``, directly or over others, in index order."""
        found, frontier = set(), [item]
        while frontier:
            for box in self.load.contacts.of(ABOVE, frontier.pop()).tolist():
                if self.present[box] and box not in found:
                    found.add(box)
                    frontier.append(box)
        return sorted(found)

    def situation(self, item: int) -> Situation:
        """Return the situation of ``item``: the boxes that decide its lift."""
        # What can move, and what that stands on or may rub against; the rest has no influence.
        dynamic = [item, *self.on_top(item)]
        static = {
            box
            for mover in dynamic
            for kind in (BELOW, BESIDE)
            for box in self.load.contacts.of(kind, mover).tolist()
            if self.present[box]
        }

        members = [*dynamic, *sorted(static.difference(dynamic))]
        boxes = self._geometry[members]
        centre = boxes[0, :3].copy()
        boxes[:, :3] -= centre  # before rounding: equal situations are equal wherever they are

        # The floor matters to the chosen box alone, a side wall to each box that moves.
        floor = -centre[2] if self._low[item, 2] <= CONTACT_TOLERANCE else None
        sides = []
        if self._low[dynamic, 1].min() <= CONTACT_TOLERANCE:
            sides.append(-centre[1])
        right = self.load.container[1]
        if self._high[dynamic, 1].max() >= right - CONTACT_TOLERANCE:
            sides.append(right - centre[1])
        pull = [int(self._pulls[item]), *self._grams[dynamic].tolist()]
        if pull == [round(PULL * USUAL), *[USUAL] * len(dynamic)]:
            pull = []
        return Situation(
            boxes=np.rint(boxes / RESOLUTION).astype(np.int32),
            dynamic=len(dynamic),
            floor=None if floor is None else round(floor / RESOLUTION),
            sides=tuple(round(side / RESOLUTION) for side in sides),
            pull=tuple(pull),
        )
