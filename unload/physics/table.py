"""Local physics with a memory: each situation is simulated once."""

from functools import cache
from threading import Lock

from unload.physics.lift_table import LiftTable
from unload.physics.local import LocalPhysics
from unload.physics.situation import Situation
from unload.support import files

HELD_DOWN = 3  # boxes on top that no lift moves
LIFTS_FILE = files.DATA / "lifts.npz"
_reading = Lock()


class TablePhysics(LocalPhysics):
    """``LocalPhysics`` that remembers: a situation met before is looked up.

    A box with three or more others on it is held down, without a simulation. Such
    situations hardly ever repeat, and of those in ``data/lift_agreement.csv`` PyBullet
    lifts none by more than 4 cm.

    Args:
        table: filled as situations are met. Share one among environments and threads to
            share their experience; one of its own if None.

    Raises:
        TypeError: ``table`` is something else.
    """

    def __init__(self, table: LiftTable | None = None) -> None:
        super().__init__()
        self.table = LiftTable() if table is None else table
        if not isinstance(self.table, LiftTable):
            raise TypeError(f"table is {table!r}; expected a LiftTable or None")

    def simulate(self, situation: Situation) -> float:
        """Look a lift up, or simulate and remember it; return the distance in m.

        Raises:
            RuntimeError: the physics is closed.
        """
        self._check_open()
        if situation.on_top >= HELD_DOWN:
            return 0.0
        distance = self.table.find(situation)
        if distance is None:
            distance = super().simulate(situation)
            self.table.add(situation, distance)
        return distance


def shared_table() -> LiftTable:
    """The lifts known to this process: those of ``data/lifts.npz``, and all made since."""
    with _reading:  # two threads that ask first get the same table
        return _read_once()


@cache
def _read_once() -> LiftTable:
    return LiftTable.load(LIFTS_FILE) if LIFTS_FILE.exists() else LiftTable()
