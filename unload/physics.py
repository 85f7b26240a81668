"""Three ways to ask PyBullet whether an item can be lifted.

All have the same interface: ``reset(load)``, ``lift(item)``, ``remove(item)``,
``positions()`` and ``close()``. ``lift`` answers how far the item moved, and it is
unloaded if that is at least ``task.LIFT_THRESHOLD``.

- ``FullPhysics``: every box of the container is simulated. The reference, and slow.
- ``LocalPhysics``: only the situation of the chosen box is simulated.
- ``TablePhysics``: ``LocalPhysics`` with a memory; each situation is simulated once.
"""

from abc import ABC, abstractmethod
from functools import cache

import numpy as np

from unload import checks, task
from unload.bullet import GAP, World
from unload.situation import RESOLUTION, Situation, Surroundings
from unload.substacks import Load

AFTER_PICK = ("restore", "restore_failure", "keep")
UPRIGHT = (0.0, 0.0, 0.0, 1.0)  # quaternion x, y, z, w


class Physics(ABC):
    """A container that answers lifts.

    Attributes:
        exact: True where unlifted boxes stay exactly where the load put them.
        present: (n,) bool, False for items that have been removed.
    """

    exact = True

    def __init__(self) -> None:
        self.present = np.zeros(0, dtype=bool)

    def reset(self, load: Load) -> None:
        """Fill the container with ``load``."""
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
        return self.load.positions

    def close(self) -> None:
        """Free the simulator."""

    def _check(self, item: int) -> int:
        item = checks.integer("item", item, 0, len(self.present) - 1)
        if not self.present[item]:
            raise ValueError(f"item {item} has been removed; expected an item in the container")
        return item

    @abstractmethod
    def _reset(self) -> None: ...

    @abstractmethod
    def _lift(self, item: int) -> float: ...

    def _remove(self, item: int) -> None: ...


class LocalPhysics(Physics):
    """Simulates the situation of the chosen box, on the load's exact grid.

    The chosen box and all that rests on it are free to move; what they stand on, their
    neighbours in the wall, the floor and the side walls are fixed; the rest is left out.
    A failed lift has no effect on the container (Sec. III-D).
    """

    def __init__(self) -> None:
        super().__init__()
        self._world = World()

    def _reset(self) -> None:
        self.surroundings = Surroundings(self.load, self.present)

    def _lift(self, item: int) -> float:
        return self.simulate(self.surroundings.situation(item))

    def simulate(self, situation: Situation) -> float:
        """Lift the chosen box of a situation; how far it moved, in m."""
        boxes = situation.boxes * RESOLUTION
        world = self._world
        bodies = [
            world.add_box(box[:3], _slim(box[3:]), task.MASS if row < situation.dynamic else 0.0)
            for row, box in enumerate(boxes)
        ]
        if situation.floor is not None:
            bodies.append(world.add_box((0, 0, situation.floor * RESOLUTION - 0.5), (9, 9, 1), 0))
        for side in situation.sides:
            outwards = np.sign(side) * 0.5
            bodies.append(world.add_box((0, side * RESOLUTION + outwards, 0), (9, 1, 9), 0))
        distance = world.pull(bodies[0])
        for body in reversed(bodies):
            world.remove(body)
        return distance

    def close(self) -> None:
        self._world.close()


class TablePhysics(LocalPhysics):
    """``LocalPhysics`` that remembers: a situation met before is looked up.

    Args:
        table: distances in m by ``Situation.key``; filled as situations are met. Share
            one table among environments to share their experience.
    """

    def __init__(self, table: dict[bytes, float] | None = None) -> None:
        super().__init__()
        self.table = {} if table is None else table

    def _lift(self, item: int) -> float:
        situation = self.surroundings.situation(item)
        distance = self.table.get(situation.key)
        if distance is None:
            distance = self.table[situation.key] = self.simulate(situation)
        return distance


class FullPhysics(Physics):
    """Simulates every box of the container.

    Boxes are created once and moved to their places at each reset (Sec. III-A).

    Args:
        after_pick: what becomes of the other boxes after a pick. ``"restore"`` puts all
            back, ``"restore_failure"`` only after a failed lift, ``"keep"`` leaves
            whatever the simulation made of them: they drift.
    """

    def __init__(self, after_pick: str = "restore") -> None:
        checks.one_of("after_pick", after_pick, AFTER_PICK)
        super().__init__()
        self.after_pick = after_pick
        self.exact = after_pick == "restore"
        self._world = World()
        self._pool: dict[tuple[int, ...], list[int]] = {}
        self._bodies: list[int | None] = []
        self._sizes: list[tuple[int, ...]] = []
        length, width, height = task.CONTAINER
        for position, size in (
            ((length / 2, width / 2, -0.5), (length + 2, width + 2, 1)),  # floor
            ((length / 2, -0.5, height / 2), (length + 2, 1, height)),  # side walls
            ((length / 2, width + 0.5, height / 2), (length + 2, 1, height)),
            ((-0.5, width / 2, height / 2), (1, width + 2, height)),  # rear wall
        ):
            self._world.add_box(position, size, 0)

    def _reset(self) -> None:
        for body, size in zip(self._bodies, self._sizes):
            self._park(body, size)
        micrometres = np.rint(self.load.sizes / RESOLUTION).astype(int)
        self._sizes = [tuple(size) for size in micrometres.tolist()]
        self._poses = [(tuple(position), UPRIGHT) for position in self.load.positions.tolist()]
        self._bodies = [
            self._take(position, size) for (position, _), size in zip(self._poses, self._sizes)
        ]

    def _take(self, position: tuple[float, ...], size: tuple[int, ...]) -> int:
        """A body of the given size (micrometres) from the pool, or a new one."""
        pool = self._pool.setdefault(size, [])
        if not pool:
            return self._world.add_box(position, _slim(np.array(size) * RESOLUTION), task.MASS)
        body = pool.pop()
        self._world.set_mass(body, task.MASS)
        self._world.place(body, position)
        return body

    def _park(self, body: int | None, size: tuple[int, ...]) -> None:
        """Put a body back into the pool: immovable, and far from all others."""
        if body is not None:
            self._world.set_mass(body, 0)
            self._world.place(body, (10.0 * body, 0.0, -100.0))
            self._pool[size].append(body)

    def settle(self, seconds: float) -> None:
        """Let time pass without a pick, and take the poses reached for the load's own."""
        checks.real("seconds", seconds, 0)
        self._world.step(seconds)
        self._keep()

    def _lift(self, item: int) -> float:
        distance = self._world.pull(self._bodies[item])
        failed = distance < task.LIFT_THRESHOLD
        if self.after_pick == "restore" or (self.after_pick == "restore_failure" and failed):
            for index in np.flatnonzero(self.present):
                self._world.place(self._bodies[index], *self._poses[index])
        else:
            self._keep()
        return distance

    def _keep(self) -> None:
        for index in np.flatnonzero(self.present):
            self._poses[index] = self._world.pose(self._bodies[index])

    def _remove(self, item: int) -> None:
        self._park(self._bodies[item], self._sizes[item])
        self._bodies[item] = None

    def positions(self) -> np.ndarray:
        return np.array([position for position, _ in self._poses])

    def close(self) -> None:
        self._world.close()


def _slim(size: np.ndarray) -> np.ndarray:
    """A box's edges with half the gap taken off each of its sides in x and y."""
    return size - np.array([GAP, GAP, 0.0])


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
def shared_table() -> dict[bytes, float]:
    """The lifts known to this process, shared by all its environments."""
    return {}
