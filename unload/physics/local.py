"""Lifts of a box in its situation: nothing else in the container is simulated."""

from collections.abc import Callable

import numpy as np

from unload import task
from unload.load.boxes import Load
from unload.physics import mujoco
from unload.physics.bullet import ENGINES, SETTINGS, World, engine_of, slim
from unload.physics.situation import RESOLUTION, Situation, Surroundings

_MOST_BODIES = 10_000  # made in a world, before what PyBullet keeps of them is cleared away


def settings_of_lifts(engine: str) -> dict:
    """An engine with its version, and all else but the boxes that its lifts depend on."""
    return SETTINGS if engine == ENGINES[0] else mujoco.settings()


class LocalPhysics:
    """Simulates the situation of the chosen box, on the load's exact grid.

    The chosen box and all that rests on it are free to move; what they stand on, their
    neighbours in the wall, the floor and the side walls are fixed; the rest is left out.
    A failed lift has no effect on the container (Sec. III-D). A lift does not depend on earlier
    ones, not in one bit, so that any number of containers may share one.

    Args:
        engine: ``"pybullet"`` or ``"mujoco"``; PyBullet where it is installed if None.
    """

    def __init__(self, engine: str | None = None) -> None:
        self.engine = engine_of(engine)
        self._world: World | None = None  # started when it is first needed, and after ``close``

    def __deepcopy__(self, memo: dict) -> "LocalPhysics":
        return self  # copies of an environment share it

    @property
    def known(self) -> tuple[int, bool, np.ndarray, np.ndarray] | None:
        """What compiled loops may answer by, without ``simulate``, see ``TablePhysics.known``.

        With None, ``simulate`` is asked about every lift.
        """
        return None

    def simulate(self, situation: Situation) -> float:
        """Pull the chosen box of a situation; return how far it moved, in m, to the micrometre."""
        return self._pull(situation)

    def _pull(
        self, situation: Situation, hopeless: Callable[[float, float, float], bool] | None = None
    ) -> float:
        """``simulate``, or give up early, see ``bullet.World.pull``."""
        if self.engine == "mujoco":
            return round(mujoco.simulate(situation, hopeless), 6)
        if self._world is None:
            self._world = World()
        elif self._world.bodies > _MOST_BODIES:
            self._world.clear()

        world = self._world
        bodies: list[int] = []
        try:
            boxes = situation.boxes * RESOLUTION
            places, sizes = boxes[:, :3].tolist(), slim(boxes[:, 3:]).tolist()
            for row, (place, size) in enumerate(zip(places, sizes)):
                mass = task.MASS if row < situation.dynamic else 0.0
                bodies.append(world.add_box(place, size, mass))
            for place, size in situation.floor_and_sides():
                bodies.append(world.add_box(place, size, 0.0))
            return round(world.pull(bodies[0], hopeless=hopeless), 6)
        finally:  # also when interrupted: what stays behind would be in the way of the next lift
            for body in reversed(bodies):
                world.remove(body)

    def lift(self, load: Load, present: np.ndarray, item: int) -> float:
        """Pull an item of a load of which the ``present`` ones are left; see ``simulate``.

        Args:
            load: without overhangs, see ``boxes.check_no_overhang``.
            present: (n,) bool, True for ``item``.
            item: its number in the load.
        """
        return self.simulate(Surroundings(load, present).situation(item))

    def close(self) -> None:
        """Free the simulator, which starts again when it is next needed."""
        if self._world is not None:
            self._world.close()
            self._world = None
