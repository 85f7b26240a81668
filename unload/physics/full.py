"""Lifts in a simulation of every box of the container; and a physics by its name."""

from typing import Literal, get_args

import numpy as np

from unload import task
from unload.load.boxes import Load
from unload.physics.base import Physics
from unload.physics.bullet import TIME_STEP, UPRIGHT, World, slim
from unload.physics.local import LocalPhysics
from unload.physics.situation import RESOLUTION
from unload.physics.table import TablePhysics, shared_table
from unload.support import checks

PhysicsName = Literal["local", "full", "table"]

_DEPOT = -100.0  # m, height of the floor far below on which removed boxes stay


class FullPhysics(Physics):
    """Simulates every box of the container.

    Args:
        after_pick: what is done with the other boxes after a pick. ``"restore"`` puts all
            back, ``"keep"`` leaves whatever the simulation made of them: they drift.
            ``"keep"`` simulates them as plain rigid bodies, ``"restore"`` as multibodies,
            see ``bullet.World``.
    """

    def __init__(self, after_pick: str = "restore") -> None:
        checks.one_of("after_pick", after_pick, ("restore", "keep"))
        super().__init__()
        self.after_pick = after_pick
        self.restores = after_pick == "restore"

    def _reset(self, load: Load) -> None:
        # Rigid bodies are twice as fast to lift, but moving them far, as putting boxes back does,
        # rebuilds a part of Bullet's search tree. Where nothing is put back, they pay.
        world = World(maximal_coordinates=self.after_pick == "keep")
        self._fill(load, world, slim(np.rint(load.sizes / RESOLUTION) * RESOLUTION))

    def _fill(self, load: Load, world: World, sizes: np.ndarray) -> None:
        """Put the boxes of a load into an empty world, as bodies of ``sizes``, (n, 3) in m."""
        self._stop()
        self._world = world
        length, width, height = self._container = load.container
        for position, size in (
            ((length / 2, width / 2, -0.5), (length + 2, width + 2, 1)),  # floor
            ((length / 2, -0.5, height / 2), (length + 2, 1, height)),  # side walls
            ((length / 2, width + 0.5, height / 2), (length + 2, 1, height)),
            ((-0.5, width / 2, height / 2), (1, width + 2, height)),  # rear wall
            ((0, 0, _DEPOT - 0.5), (2000, 2000, 1)),
        ):
            world.add_box(position, size, 0)
        self._bodies = [
            world.add_box(position, size, task.MASS)
            for position, size in zip(load.positions, sizes)
        ]
        self._poses: list[tuple] = [(place, UPRIGHT) for place in load.positions.tolist()]

    def _park(self, body: int) -> None:
        """Move a body to a place of its own in the depot."""
        row, column = divmod(body, 100)
        length, width, height = self._container
        place = ((length + 1) * row, (width + 0.5) * column, _DEPOT + height / 2)
        self._world.place(body, place)

    def settle(self, seconds: float) -> None:
        """Let time pass without a pick, and take the poses reached for the load's own."""
        self._check_filled()
        self._world.step(checks.real("seconds", seconds, 0))
        self._keep()

    def _lift(self, item: int) -> float:
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

    def _remove(self, item: int) -> None:
        self._park(self._bodies[item])

    def positions(self) -> np.ndarray:
        self._check_filled()
        return np.array([position for position, _ in self._poses])


def make_physics(physics: PhysicsName | Physics) -> Physics:
    """The physics of a name; or the one that is given, which is its caller's to close."""
    if isinstance(physics, Physics):
        return physics
    checks.one_of("physics", physics, get_args(PhysicsName))
    if physics == "table":
        return TablePhysics(shared_table())
    return FullPhysics() if physics == "full" else LocalPhysics()
