"""Lifts of a box in its situation: nothing else in the container is simulated."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import dist, hypot

import numpy as np

from unload import task
from unload.load.boxes import Load
from unload.physics import mujoco
from unload.physics.bullet import (
    ASKED_EVERY,
    ENGINES,
    ITERATIONS,
    SETTINGS,
    World,
    engine_of,
    slim,
)
from unload.physics.situation import RESOLUTION, Situation, Surroundings

_MOST_BODIES = 10_000  # made in a world, before what PyBullet keeps of them is cleared away
_TIMES_ASKED = 6  # whether a pull is hopeless: until a third of its time is left
# m. What ends so close to the threshold is simulated in full: most of the wrong answers that the
# cheaper simulation would give lie there.
_CLOSE = 0.01


def settings_of_lifts(engine: str) -> dict:
    """An engine with its version, and all else but the boxes that its lifts depend on."""
    return SETTINGS if engine == ENGINES[0] else mujoco.settings()


class LocalPhysics:
    """Simulates the situation of the chosen box, at the places of the load, without noise.

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
        """``simulate``, or, if ``hopeless`` is given, a cheaper simulation.

        Its distance differs by millimetres from that of ``simulate``, rarely by centimetres, and
        its answer hardly ever. What ends closer than ``_CLOSE`` to the threshold is simulated once
        more, in full. By MuJoCo it is the same simulation, which may only end early.

        Args:
            situation: of the box.
            hopeless: called with how far the box has moved (m), its speed (m/s) and the time that
                is left (s), each time ``ASKED_EVERY`` has passed, by PyBullet until a third of the
                time is left. If it returns True, the pull is given up, and 0 is returned.
        """
        if self.engine == "mujoco":
            return round(mujoco.simulate(situation, hopeless), 6)
        if hopeless is not None:
            distance = self._quick_pull(situation, hopeless)
            if abs(distance - task.LIFT_THRESHOLD) > _CLOSE:
                return round(distance, 6)
        with self._filled(situation) as (world, chosen):
            return round(world.pull(chosen), 6)

    def _quick_pull(
        self, situation: Situation, hopeless: Callable[[float, float, float], bool]
    ) -> float:
        """About how far a box moves, in m; 0 if its pull is given up, see ``_pull``.

        All fixed boxes are one body here, because PyBullet takes a tenth of a millisecond to make
        a body, and the solver iterates half as often. So bits differ.
        """
        with self._filled(situation, quick=True) as (world, chosen):
            start, force = world.pose(chosen)[0], (0.0, 0.0, task.PICK_FORCE)
            for number in range(1, _TIMES_ASKED + 1):
                world.step(ASKED_EVERY, chosen, force)
                left = task.LIFT_TIME - number * ASKED_EVERY
                moved, speed = dist(world.pose(chosen)[0], start), hypot(*world.velocity(chosen))
                if hopeless(moved, speed, left):
                    return 0.0
            world.step(left, chosen, force)
            return dist(world.pose(chosen)[0], start)

    @contextmanager
    def _filled(self, situation: Situation, quick: bool = False) -> Iterator[tuple[World, int]]:
        """The world with a situation's boxes, and which body is the chosen one; then it is emptied.

        Args:
            situation: of the box.
            quick: make one body of all boxes that are fixed, and let the solver iterate half as
                often.
        """
        if self._world is None:
            self._world = World()
        elif self._world.bodies > _MOST_BODIES:
            self._world.clear()

        world = self._world
        world.iterations = ITERATIONS // 2 if quick else ITERATIONS
        boxes = situation.boxes * RESOLUTION
        all_boxes = list(zip(boxes[:, :3].tolist(), slim(boxes[:, 3:]).tolist()))
        fixed = all_boxes[situation.dynamic :] + situation.floor_and_sides()
        bodies: list[int] = []
        try:
            for place, size in all_boxes[: situation.dynamic]:
                bodies.append(world.add_box(place, size, task.MASS))
            if quick and fixed:
                bodies.append(world.add_fixed(fixed))
            else:
                for place, size in fixed:
                    bodies.append(world.add_box(place, size, 0.0))
            yield world, bodies[0]
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
