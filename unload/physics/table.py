"""Local physics with a memory: each situation is simulated once.

A lift depends on its situation alone, so a table of lifts says how far the box of a situation
moved. The table is only as good as the physics that filled it: a file of another physics is
refused. Where physics leaves no doubt, rules answer instead: a box with nothing on top is free, one
with three or more others on top is held down, and so is one under one or two others that press on
its middle, or anywhere across it if it stands between others. What is simulated is given up where
it has become hopeless.
"""

import json
from functools import cache
from pathlib import Path
from threading import Lock
from typing import Literal, get_args

import numpy as np

from unload import task
from unload.load.boxes import CONTACT_TOLERANCE
from unload.physics.bullet import DAMPING, ENGINES, TIME_STEP, engine_of
from unload.physics.local import LocalPhysics, settings_of_lifts
from unload.physics.situation import RESOLUTION, Situation, parts_of_key
from unload.support import checks, files
from unload.support.compiled import compiled

PhysicsName = Literal["local", "places", "table"]

UNKNOWN = -1  # in place of a distance that is not in the table
HELD_DOWN = 3  # so many boxes on top hold a box down
# One or two boxes on top hold the chosen box down, too, if the centre of each lies near its middle:
# within a circle of this radius, where 0 is the middle, and 1 the edge along x and along y.
MIDDLE = 0.45
SMALLEST = 150_000  # µm, an edge of such a box along x or y: a smaller one tips in less time
# A box that stands between others cannot tip sideways. So along y a centre may lie anywhere from
# edge to edge, if it is no farther from the middle than MIDDLE along x. A box counts as between
# others if they cover at least this share of its left and of its right face, and if it is at most
# so many times as wide as high: a flatter one tips within the gaps.
COVERED = 0.5
FLAT = 4.0
NEAR = CONTACT_TOLERANCE / RESOLUTION  # micrometres between faces that touch, at most
HARDLY = 0.25  # of the threshold: a pull that would not even lift so far is given up
LIFTS_FILE = files.SHIPPED / "lifts.npz"
_ARRAYS = {"digests", "micrometres", "settings"}  # of a file


def free_lift() -> float:
    """How far a box moves that nothing touches, in m, by the steps that PyBullet makes."""
    velocity = distance = 0.0
    for _ in range(round(task.LIFT_TIME / TIME_STEP)):
        velocity *= (1 - DAMPING) ** TIME_STEP
        velocity += (task.PICK_FORCE / task.MASS - task.GRAVITY) * TIME_STEP
        distance += velocity * TIME_STEP
    return round(distance, 6)


# Physics makes boxes 1 mm narrower, so a box with nothing on top rubs against nothing, and moves
# equally far in every load, whatever its size: PyBullet says the same to the micrometre.
FREE_LIFT = free_lift()


class LiftTable:
    """Distances in micrometres by the digest of a situation; empty at first.

    A lift that was given up has 0, see ``TablePhysics``.

    Two arrays, so that compiled code can look into them, too. Among a million situations two
    share a 64-bit digest with a probability of 3e-8.

    Any number of threads may find and add at the same time. Only adding takes a lock, and replaces
    both arrays at once, so that whoever still reads the old ones misses a new entry at most.

    Args:
        engine: whose lifts it holds, see ``LocalPhysics``.

    Attributes:
        entries: all digests, (n,) uint64 in increasing order, and their distances, (n,) int32.
        foreign: digests of another engine's lifts, which are answers here and never written.
    """

    def __init__(self, engine: str | None = None) -> None:
        self.engine = engine_of(engine)
        self._adding = Lock()
        self.foreign = np.zeros(0, np.uint64)
        self.entries = np.zeros(0, np.uint64), np.zeros(0, np.int32)

    def __len__(self) -> int:
        return len(self.entries[0])

    def find(self, situation: Situation) -> float | None:
        """Return the distance in m that the table holds for a situation, or None."""
        micrometres = find_distance(*self.entries, situation.digest)
        return None if micrometres == UNKNOWN else int(micrometres) / 1e6

    def add(self, situation: Situation, distance: float) -> None:
        """Remember a distance in m, to the micrometre. A situation that is known keeps its own."""
        digest = situation.digest
        with self._adding:
            digests, micrometres = self.entries
            place = np.searchsorted(digests, digest)
            if place == len(digests) or digests[place] != digest:
                new = _inserted(micrometres, place, round(distance * 1e6))
                self.entries = _inserted(digests, place, digest), new

    def save(self, path: str | Path) -> None:
        """Write the table as ``.npz``, in one atomic step; equal tables give equal bytes."""
        digests, micrometres = self.entries
        own = ~np.isin(digests, self.foreign)
        arrays: dict[str, np.ndarray] = {
            "digests": digests[own],
            "micrometres": micrometres[own],
            "settings": np.array(json.dumps(settings_of_lifts(self.engine))),
        }
        files.write_arrays(path, arrays)

    @classmethod
    def load(cls, path: str | Path, engine: str | None = None) -> "LiftTable":
        """Read a table that ``save`` wrote; ValueError if damaged or of other physics settings."""
        # Of a damaged file nothing is taken, nor of one that holds another physics' answers.
        table = cls(engine)
        arrays = files.read_arrays(path, checked=True)
        if not _ARRAYS <= set(arrays):
            raise ValueError(f"{path} holds {sorted(arrays)}; expected a lift table")
        settings, wanted = str(arrays["settings"]), json.dumps(settings_of_lifts(table.engine))
        if settings != wanted:
            raise ValueError(
                f"{path} is of another physics, {settings}; expected {wanted}. "
                "Remove it to fill a new one"
            )

        table.entries = arrays["digests"], arrays["micrometres"]
        return table


class TablePhysics(LocalPhysics):
    """``LocalPhysics`` that remembers: a situation met before is looked up.

    A box with nothing on top moves by ``free_lift``, as PyBullet says. One with three or more
    others on it counts as held down and is not simulated: such situations hardly ever repeat, and
    of those in ``data/lift_agreement.csv`` PyBullet lifts none by more than 4 cm. What the table
    lacks is held down where one or two others lie on or near its middle (see ``held_by_rule``),
    and simulated elsewhere, in less than half of the time that ``LocalPhysics`` takes: the distance
    differs by millimetres, rarely by centimetres, and the answer hardly ever
    (``data/certain_lifts.csv``). A lift that is certain to fail says 0 m.

    Args:
        table: filled by its engine as situations are met. Share one among environments to share
            their experience; one of its own if None.
        exact: simulate each lift that the table lacks as ``LocalPhysics`` does, to the same bits,
            if fewer than ``held_down`` boxes lie on the chosen one: for a table that is kept.
        held_down: so many boxes on top hold a box down. With 1 the boxes' places alone decide.
    """

    def __init__(
        self, table: LiftTable | None = None, exact: bool = False, held_down: int = HELD_DOWN
    ) -> None:
        self.table = LiftTable() if table is None else table
        self.exact = checks.boolean("exact", exact)
        self.held_down = checks.integer("held_down", held_down, 1)
        super().__init__(self.table.engine)

    @property
    def known(self) -> tuple[int, bool, np.ndarray, np.ndarray] | None:
        """``held_down``, whether ``held_by_rule`` answers, and the entries of its table.

        None for a subclass, whose ``simulate`` no loop knows.
        """
        own = type(self) is TablePhysics
        return (self.held_down, not self.exact, *self.table.entries) if own else None

    def simulate(self, situation: Situation) -> float:
        """Look a lift up, or simulate and remember it; return the distance in m."""
        if situation.on_top == 0:
            return FREE_LIFT
        if situation.on_top >= self.held_down:
            return 0.0
        distance = self.table.find(situation)
        if distance is None:
            if not self.exact and held_by_rule(np.frombuffer(situation.key, np.int32)):
                return 0.0
            distance = self._pull(situation, None if self.exact else hopeless)
            self.table.add(situation, distance)
        return distance


def hopeless(moved: float, speed: float, left: float) -> bool:
    """Whether a pull will not lift a box any more.

    It is hopeless if even a free rise for the rest of the time would end below the threshold, or if
    the box, with the mean acceleration that it has had so far, would reach no more than a quarter
    of the threshold (``HARDLY``).

    Args:
        moved: m, so far.
        speed: m/s, of its centre.
        left: s, of the pull.
    """
    free = task.PICK_FORCE / task.MASS - task.GRAVITY
    mean = speed / (task.LIFT_TIME - left)
    freely, as_before = (moved + speed * left + a * left**2 / 2 for a in (free, mean))
    return freely < task.LIFT_THRESHOLD or as_before < HARDLY * task.LIFT_THRESHOLD


@cache
def shared_table() -> LiftTable:
    """The lifts known to this process: PyBullet's in ``LIFTS_FILE``, and all made since."""
    table = LiftTable.load(LIFTS_FILE, ENGINES[0])
    if table.engine != engine_of():  # PyBullet's answers serve where it is missing, too
        table.engine, table.foreign = engine_of(), table.entries[0]
    return table


def make_physics(physics: PhysicsName | LocalPhysics) -> LocalPhysics:
    """The physics of a name; or the one that is given."""
    if isinstance(physics, LocalPhysics):
        return physics
    names = ", ".join(map(repr, get_args(PhysicsName)))
    wanted = f"expected {names}, or a LocalPhysics, whose simulate decides a lift"
    if not isinstance(physics, str):
        raise TypeError(f"physics is {physics!r}; {wanted}")
    if physics not in get_args(PhysicsName):
        raise ValueError(f"physics is {physics!r}; {wanted}")
    if physics == "local":
        return LocalPhysics()
    return TablePhysics(shared_table()) if physics == "table" else TablePhysics(held_down=1)


def _inserted(array: np.ndarray, place: np.integer, value: int | np.integer) -> np.ndarray:
    """What ``np.insert`` makes, in half the time."""
    return np.concatenate((array[:place], array.dtype.type(value)[np.newaxis], array[place:]))


@compiled
def find_distance(digests, micrometres, digest):
    """The distance of a digest in micrometres, or ``UNKNOWN``."""
    place = np.searchsorted(digests, digest)
    known = place < len(digests) and digests[place] == digest
    return micrometres[place] if known else UNKNOWN


@compiled
def held_by_rule(key):
    """Whether what lies on the chosen box, one box or two, holds it down.

    In random loads and random stacks of boxes of any proportions, no lift contradicts this
    (``data/certain_lifts.csv``), nor did a search that climbs from such stacks.

    The pull can raise 1.04 boxes besides the chosen one. So with one box on its middle the chosen
    one rises by 9 mm only. With one off its middle it tips aside, unless it stands between others.
    See ``MIDDLE``, ``SMALLEST`` and ``COVERED``.

    Args:
        key: the words of a situation's key, see ``Situation.key``.
    """
    _, first = parts_of_key(key)
    width, depth = key[first + 4], key[first + 3]
    if key[0] - 1 >= HELD_DOWN or min(width, depth) < SMALLEST:
        return False
    middle = across = True  # whether all centres lie near the middle, or near the line across it
    for box in range(first + 6, first + 6 * key[0], 6):
        x, y = 2 * key[box] / depth, 2 * key[box + 1] / width
        middle &= x * x + y * y <= MIDDLE**2
        across &= abs(x) <= MIDDLE and abs(y) <= 1
    return middle or (across and _between_others(key, first))


@compiled
def _between_others(key, first):
    """Whether boxes or side walls cover both sides of the chosen box, see ``COVERED``."""
    depth, width, height = key[first + 3], key[first + 4], key[first + 5]
    if width > FLAT * height:
        return False
    near = width / 2 + NEAR  # its sides are so far from its centre
    left = right = 0.0  # shares of its faces
    sides, _ = parts_of_key(key)
    for side in key[sides:first]:
        if abs(side) <= near and side < 0:
            left = 1.0
        elif abs(side) <= near:
            right = 1.0
    for box in range(first + 6 * key[0], len(key), 6):
        face = abs(key[box + 1]) - key[box + 4] / 2
        x = _shared(key[box], key[box + 3], depth)
        z = _shared(key[box + 2], key[box + 5], height)
        if 0 < face <= near and x > 0 and z > 0:
            if key[box + 1] < 0:
                left += x * z
            else:
                right += x * z
    return min(left, right) >= COVERED


@compiled
def _shared(centre, length, edge):
    """The share of an edge around 0 that an interval covers; below 0 if it does not."""
    return (min(centre + length / 2, edge / 2) - max(centre - length / 2, -edge / 2)) / edge
