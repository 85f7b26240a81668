"""Lifts in a simulation of every box of the container."""

import numpy as np

from unload import task
from unload.load.boxes import Load, check_load
from unload.physics.bullet import TIME_STEP, UPRIGHT, World, slim
from unload.physics.situation import RESOLUTION
from unload.support import checks

_DEPOT = -100.0  # m, height of the floor far below on which removed boxes stay


class FullPhysics:
    """A container whose every box is simulated.

    Args:
        after_pick: what is done with the other boxes after a pick. ``"restore"`` puts all
            back, ``"keep"`` leaves whatever the simulation made of them: they drift.
            ``"keep"`` simulates them as plain rigid bodies, ``"restore"`` as multibodies,
            see ``bullet.World``.

    Attributes:
        load: what it was filled with, None before the first ``reset`` and after ``close``.
        present: (n,) bool, False for items that have been removed.

    Raises:
        RuntimeError: a method is called while it holds no load.
        TypeError: the load is not a ``Load``, or the item is no integer.
        ValueError: the item does not exist or has been removed.
    """

    def __init__(self, after_pick: str = "restore") -> None:
        checks.one_of("after_pick", after_pick, ("restore", "keep"))
        self.after_pick = after_pick
        self.load: Load | None = None
        self.present = np.zeros(0, bool)
        self._world: World | None = None

    def reset(self, load: Load) -> None:
        """Fill the container with ``load``."""
        check_load(load)
        self.close()  # until it is filled: nothing may be lifted in a half-filled container
        # Rigid bodies are twice as fast to lift, but moving them far, as putting boxes back does,
        # rebuilds a part of Bullet's search tree. Where nothing is put back, they pay.
        world = World(maximal_coordinates=self.after_pick == "keep")
        self._world = world
        length, width, height = load.container
        for position, size in (
            ((length / 2, width / 2, -0.5), (length + 2, width + 2, 1)),  # floor
            ((length / 2, -0.5, height / 2), (length + 2, 1, height)),  # side walls
            ((length / 2, width + 0.5, height / 2), (length + 2, 1, height)),
            ((-0.5, width / 2, height / 2), (1, width + 2, height)),  # rear wall
            ((0, 0, _DEPOT - 0.5), (2000, 2000, 1)),
        ):
            world.add_box(position, size, 0)
        sizes = slim(np.rint(load.sizes / RESOLUTION) * RESOLUTION)
        self._bodies = [
            world.add_box(position, size, task.MASS)
            for position, size in zip(load.positions, sizes)
        ]
        self._poses: list[tuple] = [(place, UPRIGHT) for place in load.positions.tolist()]
        self.load, self.present = load, np.ones(len(load), bool)

    def _park(self, body: int) -> None:
        """Move a body to a place of its own in the depot."""
        row, column = divmod(body, 100)
        length, width, height = self.load.container
        place = ((length + 1) * row, (width + 0.5) * column, _DEPOT + height / 2)
        self._world.place(body, place)

    def settle(self, seconds: float) -> None:
        """Let time pass without a pick, and take the poses reached for the load's own."""
        self._check_filled()
        self._world.step(checks.real("seconds", seconds, 0))
        self._keep()

    def lift(self, item: int) -> float:
        """Try to lift an item; return how far it moved, in m (Sec. III-C, appendix)."""
        item = self._check(item)
        restore = True  # also when interrupted: no box may stay halfway
        try:
            distance = self._world.pull(self._bodies[item])
            restore = self.after_pick == "restore"
            return distance
        finally:
            self._restore() if restore else self._keep()

    def _restore(self) -> None:
        present = np.flatnonzero(self.present)
        # The container is emptied first, so that Bullet forgets the contacts in it. A box that is
        # only moved keeps its old ones: it may be flung by up to a metre, or held by nothing.
        for index in present:
            self._park(self._bodies[index])
        self._world.step(TIME_STEP)
        for index in present:
            self._world.place(self._bodies[index], *self._poses[index])

    def _keep(self) -> None:
        for index in np.flatnonzero(self.present):
            self._poses[index] = self._world.pose(self._bodies[index])

    def remove(self, item: int) -> None:
        """Take an item out of the container."""
        item = self._check(item)
        self.present[item] = False
        self._park(self._bodies[item])

    def positions(self) -> np.ndarray:
        """(n, 3) float64, the centre of each item in m; removed items keep their last one."""
        self._check_filled()
        return np.array([position for position, _ in self._poses])

    def close(self) -> None:
        """Empty the container and free the simulator; ``reset`` starts it again."""
        self.load = None
        if self._world is not None:
            self._world.close()
            self._world = None

    def _check_filled(self) -> None:
        if self.load is None:
            raise RuntimeError("the physics holds no load; call reset first")

    def _check(self, item: int) -> int:
        self._check_filled()
        item = checks.integer("item", item, 0, len(self.present) - 1)
        if not self.present[item]:
            raise ValueError(f"item {item} has been removed; expected an item in the container")
        return item
