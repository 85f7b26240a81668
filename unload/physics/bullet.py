"""PyBullet, which only this file imports: when the first ``World`` is made, as it is optional.

A ``World`` is one PyBullet client with boxes in it. It knows nothing of loads,
observations or rewards, and checks nothing: that is done where loads, forces and times enter.
"""

import os
import weakref
from collections.abc import Sequence
from contextlib import contextmanager
from functools import cache, partial
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from typing import Any

import numpy as np

from unload import task
from unload.support import checks

ENGINES = ("pybullet", "mujoco")  # that can simulate lifts, the reference first


@cache
def engine_of(name: str | None = None) -> str:
    """Return the name of an engine; without one PyBullet, unless only MuJoCo is installed."""
    checks.one_of("engine", name, (None, *ENGINES))
    return name or next((each for each in ENGINES if find_spec(each)), ENGINES[0])


@contextmanager
def _quiet_stderr():
    """Hide what PyBullet's C code prints while it is imported: its build time."""
    try:
        saved = os.dup(2)
    except OSError:  # stderr is closed: there is nothing to hide
        yield
        return
    with open(os.devnull, "wb") as null, open(saved, "wb"):
        os.dup2(null.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(saved, 2)


@cache
def _pybullet() -> Any:
    """PyBullet, imported when it is first needed."""
    with _quiet_stderr():
        try:
            import pybullet
        except ModuleNotFoundError:
            raise ModuleNotFoundError(
                "PyBullet, which simulates whole containers and heaps, is not installed: take "
                "Python 3.11 on Linux x86-64 (pip install pybullet); elsewhere MuJoCo simulates "
                "lifts (pip install mujoco-core), for physics='local' and 'table'"
            ) from None
    return pybullet


def _version() -> str:
    """Version of PyBullet; where it is missing, the one that made the shipped lifts."""
    try:
        return version("pybullet")
    except PackageNotFoundError:
        return "3.2.7"


TIME_STEP = 1 / 240  # s; halving it changes no lift, 1/60 changes 2 % of the hard ones
# Bullet multiplies the friction of the two bodies in contact: 0.5 each gives 0.25.
FRICTION = 0.5
# Bullet's default for multibodies, stated here because maximal coordinates default to 0.
DAMPING = 0.04
# Boxes are made this much narrower (x and y), so that neighbours do not rub: side by
# side without a gap, free boxes rise less, and at a higher friction many jam.
GAP = 0.001  # m
_GAPS = np.array([GAP, GAP, 0.0])
# What a lift's outcome depends on besides the boxes; the solver is left as PyBullet has it.
SETTINGS = {
    "pybullet": _version(),
    "time_step": TIME_STEP,
    "friction": FRICTION,
    "damping": DAMPING,
    "gap": GAP,
    "mass": task.MASS,
    "gravity": task.GRAVITY,
    "force": task.PICK_FORCE,
    "lift_time": task.LIFT_TIME,
}

UPRIGHT = (0.0, 0.0, 0.0, 1.0)  # orientation of a box that is not turned
ITERATIONS = 50
# Every so many s a pull that may be given up is judged, see ``table.hopeless``: after 8 of its 72
# steps half of those that fail are given up.
ASKED_EVERY = 8 * TIME_STEP


def slim(size: np.ndarray) -> np.ndarray:
    """A box's edges in m with half the gap taken off each of its sides in x and y."""
    return size - _GAPS


class Client:
    """One PyBullet client: PyBullet's functions, called without its number, and constants.

    It is disconnected by ``disconnect``, or when nothing refers to it any more.
    """

    def __init__(self) -> None:
        self.number = _pybullet().connect(_pybullet().DIRECT)
        self.disconnect = weakref.finalize(self, _pybullet().disconnect, self.number)

    def __reduce_ex__(self, protocol):
        """Refuse to be copied or pickled, because both would step the same simulator."""
        raise TypeError("a simulator of PyBullet cannot be copied or pickled; make another one")

    def __getattr__(self, name: str) -> Any:
        found = getattr(_pybullet(), name)
        if callable(found):
            found = partial(found, physicsClientId=self.number)
        setattr(self, name, found)  # found without this function the next time
        return found


class World:
    """One PyBullet client (about 28 MB) with gravity, holding boxes.

    Bodies never fall asleep: PyBullet's external force does not wake a sleeping body,
    so that a free box would not move at all.

    Attributes:
        client: see ``Client``.
        bodies: how many have been created since the world was new or cleared. PyBullet keeps 1 KB
            of each after it is removed, and 4 KB of each shape.
        iterations: of the next steps; may be set.

    Args:
        time_step: s per ``stepSimulation``.
        maximal_coordinates: plain rigid bodies instead of Featherstone multibodies; 1.6 to
            2 times as fast. A lift's answer is the same; left alone, boxes creep a fifth less.
        iterations: of the contact solver per time step; 50 is PyBullet's default.
    """

    def __init__(
        self,
        time_step: float = TIME_STEP,
        maximal_coordinates: bool = True,
        iterations: int = ITERATIONS,
    ) -> None:
        self.time_step, self.iterations = time_step, iterations
        self._maximal = maximal_coordinates
        self.client = Client()
        self.clear()

    def clear(self) -> None:
        """Take everything out; the next bodies behave, to the bit, as in a new world."""
        self._shapes: dict[tuple[float, ...], int] = {}
        self.bodies = 0
        self.client.resetSimulation()
        self.client.setGravity(0, 0, -task.GRAVITY)
        self.client.setPhysicsEngineParameter(deterministicOverlappingPairs=1)

    def add_box(
        self,
        position: Sequence[float] | np.ndarray,
        size: Sequence[float] | np.ndarray,
        mass: float,
        orientation: Sequence[float] = UPRIGHT,
        friction: float = FRICTION,
    ) -> int:
        """Create a box and return its body number; mass 0 makes it immovable.

        Args:
            position, size: (3,) centre and edge lengths in m.
            mass: kg.
            orientation: (4,) quaternion x, y, z, w.
            friction: of its surface; Bullet multiplies it with the other body's.
        """
        halves = tuple(float(edge) / 2 for edge in size)
        if halves not in self._shapes:
            shape = self.client.createCollisionShape(self.client.GEOM_BOX, halfExtents=halves)
            self._shapes[halves] = shape
        return self._add(self._shapes[halves], mass, position, orientation, friction)

    def add_fixed(self, boxes: Sequence[tuple[Sequence[float], Sequence[float]]]) -> int:
        """Create one immovable body of several boxes, and return its number.

        Whatever a body consists of, PyBullet takes a tenth of a millisecond to make it.

        Args:
            boxes: centre and edge lengths of each, (3,) in m.
        """
        shape = self.client.createCollisionShapeArray(  # of lists: tuples make PyBullet crash
            shapeTypes=[self.client.GEOM_BOX] * len(boxes),
            halfExtents=[[edge / 2 for edge in size] for _, size in boxes],
            collisionFramePositions=[place for place, _ in boxes],
        )
        return self._add(shape, 0.0)

    def _add(
        self,
        shape: int,
        mass: float,
        position: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
        orientation: Sequence[float] = UPRIGHT,
        friction: float = FRICTION,
    ) -> int:
        """Create a body of a shape, see ``add_box``."""
        self.bodies += 1
        body = self.client.createMultiBody(
            mass,
            shape,
            basePosition=position,
            baseOrientation=orientation,
            useMaximalCoordinates=self._maximal,
        )
        # Friction and damping are stated, because PyBullet's own differ between kinds of bodies.
        self.client.changeDynamics(
            body, -1, lateralFriction=friction, linearDamping=DAMPING, angularDamping=DAMPING
        )
        return body

    def remove(self, body: int) -> None:
        """Take a body out of the world; its number is not given again."""
        self.client.removeBody(body)

    def place(self, body: int, position, orientation=UPRIGHT) -> None:
        """Put a body at rest at ``position`` (m) with ``orientation`` (quaternion x, y, z, w)."""
        # This call also sets the velocities to zero.
        self.client.resetBasePositionAndOrientation(body, position, orientation)

    def pose(self, body: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Position (m) and orientation (quaternion x, y, z, w) of a body."""
        return self.client.getBasePositionAndOrientation(body)

    def velocity(self, body: int) -> tuple[float, ...]:
        """Velocity of a body's centre along x, y and z, in m/s."""
        return self.client.getBaseVelocity(body)[0]

    def step(
        self,
        seconds: float,
        body: int | None = None,
        force: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> None:
        """Let time pass, rounded to whole time steps.

        Meanwhile ``force``, in N, acts at the centre of mass of ``body``, if one is given.
        """
        steps = round(seconds / self.time_step)
        while steps:
            # One call makes many steps, and the force lasts for the whole call. Their number is a
            # power of two, because PyBullet divides the time by it, and only that is exact.
            many = 1 << (steps.bit_length() - 1)
            self.client.setPhysicsEngineParameter(
                fixedTimeStep=many * self.time_step,
                numSubSteps=many,
                numSolverIterations=self.iterations,
            )
            if body is not None:
                place, frame = self.pose(body)[0], self.client.WORLD_FRAME
                self.client.applyExternalForce(body, -1, force, place, frame)
            self.client.stepSimulation()
            steps -= many

    def pull(
        self,
        body: int,
        force: float = task.PICK_FORCE,
        seconds: float = task.LIFT_TIME,
    ) -> float:
        """Pull a body upwards at its centre of mass; return how far it moved, in m (Sec. III-C).

        Args:
            body: which one.
            force: N.
            seconds: how long, rounded to whole time steps.
        """
        start = np.array(self.pose(body)[0])
        self.step(seconds, body, (0.0, 0.0, force))
        return float(np.linalg.norm(np.array(self.pose(body)[0]) - start))

    def close(self) -> None:
        """Disconnect the client; may be called again."""
        self.client.disconnect()
