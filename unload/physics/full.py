"""Three ways to ask PyBullet whether an item can be lifted.

All have ``reset(load)``, ``lift(item)``, ``remove(item)``, ``positions()`` and
``close()``. ``lift`` answers how far the item moved, and it is unloaded if that is at
least ``task.LIFT_THRESHOLD``.

- ``FullPhysics``: every box of the container is simulated. The reference, and slow. It
  alone has ``settle(seconds)``.
- ``LocalPhysics``: only the situation of the chosen box is simulated. It alone has
  ``simulate(situation)``.
- ``TablePhysics``: ``LocalPhysics`` with a memory; each situation is simulated once. If
  three or more boxes rest on the chosen one, it answers 0 without asking PyBullet.
"""

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Sequence
from functools import cache

import numpy as np

from unload import task
from unload.load.boxes import Load
from unload.physics.bullet import TIME_STEP, World, slim
from unload.physics.situation import RESOLUTION, Situation, Surroundings, lift
from unload.physics.table import LiftTable
from unload.support import checks, files

AFTER_PICK = ("restore", "restore_failure", "keep")
LIFTS = files.DATA / "lifts.npz"
DEPOT = -100.0  # m, height of the floor far below on which spare boxes wait
UPRIGHT = (0.0, 0.0, 0.0, 1.0)  # quaternion x, y, z, w


class Physics(ABC):
    """A container that answers lifts.

    Attributes:
        exact: True where unlifted boxes stay exactly where the load put them.
        load: the load, None before the first ``reset``.
        present: (n,) bool, False for items that have been removed.

    Raises:
        RuntimeError: a method is called before ``reset`` or after ``close``.
    """

    exact = True

    def __init__(self) -> None:
        self.load: Load | None = None
        self.present = np.zeros(0, dtype=bool)
        self._closed = False

    def reset(self, load: Load) -> None:
        """Fill the container with ``load``.

        Raises:
            TypeError: ``load`` is not a ``Load``.
        """
        self._check_open()
        if not isinstance(load, Load):
            raise TypeError(f"load is {load!r}; expected an unload.Load")
        self.load = load
        self.present = np.ones(len(load), dtype=bool)
        self._reset()

    def lift(self, item: int) -> float:
        """Try to lift an item; how far it moved, in m (Sec. III-C, appendix).

        Raises:
            ValueError: the item does not exist or has been removed.
        """
        return self._lift(self._check(item))

    def remove(self, item: int) -> None:
        """Take an item out of the container.

        Raises:
            ValueError: the item does not exist or has been removed.
        """
        item = self._check(item)
        self.present[item] = False
        self._remove(item)

    def positions(self) -> np.ndarray:
        """(n, 3) float64, the centre of each item in m; removed items keep their last one."""
        self._check_filled()
        return self._positions()

    def close(self) -> None:
        """Free the simulator; may be called again."""
        self._closed = True

    def _check_open(self) -> None:
        if self._closed:
            raise RuntimeError("the physics is closed; make a new one")

    def _check_filled(self) -> None:
        self._check_open()
        if self.load is None:
            raise RuntimeError("the physics holds no load; call reset first")

    def _check(self, item: int) -> int:
        self._check_filled()
        item = checks.integer("item", item, 0, len(self.present) - 1)
        if not self.present[item]:
            raise ValueError(f"item {item} has been removed; expected an item in the container")
        return item

    @abstractmethod
    def _reset(self) -> None: ...

    @abstractmethod
    def _lift(self, item: int) -> float: ...

    def _remove(self, item: int) -> None: ...

    def _positions(self) -> np.ndarray:
        return self.load.positions


class SituationPhysics(Physics):
    """Base of those that ask for the situation of the chosen box only."""

    def _reset(self) -> None:
        self.surroundings = Surroundings(self.load, self.present)


class LocalPhysics(SituationPhysics):
    """Simulates the situation of the chosen box, on the load's exact grid.

    The chosen box and all that rests on it are free to move; what they stand on, their
    neighbours in the wall, the floor and the side walls are fixed; the rest is left out.
    A failed lift has no effect on the container (Sec. III-D).
    """

    def __init__(self) -> None:
        super().__init__()
        self._world = World()

    def _lift(self, item: int) -> float:
        return self.simulate(self.surroundings.situation(item))

    def simulate(self, situation: Situation) -> float:
        """Lift the chosen box of a situation; how far it moved, in m."""
        self._check_open()
        return lift(self._world, situation)

    def close(self) -> None:
        super().close()
        self._world.close()


class TablePhysics(SituationPhysics):
    """``LocalPhysics`` that remembers: a situation met before is looked up.

    A box with three or more others on it is held down without asking, see ``LiftTable``.

    Args:
        table: filled as situations are met. Share one among environments to share their
            experience; one of its own if None, closed with it.

    Raises:
        TypeError: ``table`` is something else.
    """

    def __init__(self, table: LiftTable | None = None) -> None:
        super().__init__()
        self._owns_table = table is None
        self.table = LiftTable() if table is None else table
        if not isinstance(self.table, LiftTable):
            raise TypeError(f"table is {table!r}; expected a LiftTable or None")

    def _lift(self, item: int) -> float:
        return self.table.lift(self.surroundings.situation(item))

    def close(self) -> None:
        super().close()
        if self._owns_table:
            self.table.close()


class FullPhysics(Physics):
    """Simulates every box of the container.

    Boxes are created once and moved to their places at each reset (Sec. III-A).

    Args:
        after_pick: what becomes of the other boxes after a pick. ``"restore"`` puts all
            back, ``"restore_failure"`` only after a failed lift, ``"keep"`` leaves
            whatever the simulation made of them: they drift. ``"keep"`` simulates them
            as plain rigid bodies, the others as multibodies, see ``unload.bullet.World``.
    """

    def __init__(self, after_pick: str = "restore") -> None:
        checks.one_of("after_pick", after_pick, AFTER_PICK)
        super().__init__()
        self.after_pick = after_pick
        self.exact = after_pick == "restore"
        # Rigid bodies are twice as fast to lift, but moving them far rebuilds a part of
        # Bullet's search tree: a reset takes longer than creating them anew. Where nothing
        # is put back, resets are rare beside lifts.
        self._world = World(maximal_coordinates=after_pick == "keep")
        self._bodies_of_size: dict[tuple[int, ...], list[int]] = {}  # by edges in micrometres
        self._bodies: list[int] = []  # of the load's items
        length, width, height = task.CONTAINER
        for position, size in (
            ((length / 2, width / 2, -0.5), (length + 2, width + 2, 1)),  # floor
            ((length / 2, -0.5, height / 2), (length + 2, 1, height)),  # side walls
            ((length / 2, width + 0.5, height / 2), (length + 2, 1, height)),
            ((-0.5, width / 2, height / 2), (1, width + 2, height)),  # rear wall
            ((0, 0, DEPOT - 0.5), (2000, 2000, 1)),
        ):
            self._world.add_box(position, size, 0)

    def _reset(self) -> None:
        self._clear(self._bodies)
        sizes = np.rint(self.load.sizes / RESOLUTION).astype(int).tolist()
        self._poses = [(tuple(position), UPRIGHT) for position in self.load.positions.tolist()]
        self._bodies = []
        used: Counter[tuple[int, ...]] = Counter()
        for (position, _), edges in zip(self._poses, sizes):
            size = tuple(edges)
            self._bodies.append(self._take(size, used[size], position))
            used[size] += 1

    def _take(self, size: tuple[int, ...], number: int, position: tuple[float, ...]) -> int:
        """Put the body of this size and number in its place; create it if there is none."""
        bodies = self._bodies_of_size.setdefault(size, [])
        if number == len(bodies):
            edges = slim(np.array(size) * RESOLUTION)
            bodies.append(self._world.add_box(position, edges, task.MASS))
            return bodies[number]
        self._world.place(bodies[number], position)
        return bodies[number]

    def _clear(self, bodies: Sequence[int]) -> None:
        """Empty the container, so that Bullet forgets the contacts in it.

        A box that is only moved keeps its old contacts: it may be flung by up to a metre, or
        held though nothing touches it any more.
        """
        for body in bodies:
            self._park(body)
        self._world.step(TIME_STEP)

    def _park(self, body: int) -> None:
        """Keep a body for a later load, on a place of its own in the depot."""
        row, column = divmod(body, 100)
        self._world.place(body, (8.0 * row, 3.0 * column, DEPOT + task.CONTAINER[2] / 2))

    def settle(self, seconds: float) -> None:
        """Let time pass without a pick, and take the poses reached for the load's own."""
        self._check_filled()
        self._world.step(seconds)
        self._keep()

    def _lift(self, item: int) -> float:
        distance = self._world.pull(self._bodies[item])
        failed = distance < task.LIFT_THRESHOLD
        if self.after_pick == "restore" or (self.after_pick == "restore_failure" and failed):
            present = np.flatnonzero(self.present)
            self._clear([self._bodies[index] for index in present])
            for index in present:
                self._world.place(self._bodies[index], *self._poses[index])
        else:
            self._keep()
        return distance

    def _keep(self) -> None:
        for index in np.flatnonzero(self.present):
            self._poses[index] = self._world.pose(self._bodies[index])

    def _remove(self, item: int) -> None:
        self._park(self._bodies[item])

    def _positions(self) -> np.ndarray:
        return np.array([position for position, _ in self._poses])

    def close(self) -> None:
        super().close()
        self._world.close()


def make_physics(name: str, after_pick: str = "restore") -> Physics:
    """The physics of the given name: ``"local"``, ``"full"`` or ``"table"``.

    Args:
        name: which physics.
        after_pick: see ``FullPhysics``; the other two always restore.

    Raises:
        ValueError: an unknown name, or ``after_pick`` other than ``"restore"`` for a
            physics that always restores.
    """
    checks.one_of("physics", name, ("local", "full", "table"))
    checks.one_of("after_pick", after_pick, AFTER_PICK)
    if name == "full":
        return FullPhysics(after_pick)
    if after_pick != "restore":
        raise ValueError(f"after_pick is {after_pick!r}; expected 'restore' for physics={name!r}")
    return LocalPhysics() if name == "local" else TablePhysics(shared_table())


@cache
def shared_table() -> LiftTable:
    """The lifts known to this process: those of ``data/lifts.npz``, and all made since."""
    return LiftTable.load(LIFTS) if LIFTS.exists() else LiftTable()
