"""PyBullet, and the only file that imports it, with the first ``World``: it is optional.

A ``World`` is one PyBullet client with boxes in it. It knows nothing of loads,
observations or rewards, and checks nothing: that is done where loads, forces and times enter.
"""

import os
import weakref
from collections.abc import Sequence
from contextlib import contextmanager
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING

import numpy as np

from unload import task

if TYPE_CHECKING:
    import pybullet


@contextmanager
def _quiet_stderr():
    """Hide what PyBullet's C code prints while it is imported: its build time."""
    try:
        saved = os.dup(2)
    except OSError:  # stderr is closed: there is nothing to hide
        yield
        return
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 2)
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(null)


@cache
def _import_pybullet() -> None:
    """Import PyBullet.

    Raises:
        ModuleNotFoundError: it is not installed.
    """
    global pybullet
    with _quiet_stderr():
        try:
            import pybullet
        except ModuleNotFoundError as error:
            raise ModuleNotFoundError(
                "a lift that no table knows, a whole container or a heap has to be simulated; "
                "expected PyBullet: pip install 'unload[pybullet]'"
            ) from error


def _version() -> str:
    """Of PyBullet; without it that of the lifts that ship, because there can be no others."""
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
# side without a gap, free boxes rise less, and in a full simulation many jam.
GAP = 0.001  # m
# All that a lift's outcome depends on besides the boxes.
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
NEAR_PLANE, FAR_PLANE = 0.1, 50.0  # m, what a camera sees
ITERATIONS = 50


def slim(size: np.ndarray) -> np.ndarray:
    """A box's edges in m with half the gap taken off each of its sides in x and y."""
    return size - np.array([GAP, GAP, 0.0])


class World:
    """One PyBullet client (about 28 MB) with gravity, holding boxes.

    The client is disconnected by ``close``, or when nothing refers to the world any more.

    Bodies never fall asleep: PyBullet's external force does not wake a sleeping body,
    so that a free box would not move at all.

    Attributes:
        bodies: how many have been created since the world was new or cleared. PyBullet keeps 1 KB
            of each after it is removed, and 4 KB of each size.

    Args:
        time_step: s per ``stepSimulation``.
        maximal_coordinates: plain rigid bodies instead of Featherstone multibodies; 1.6 to
            2 times as fast. A lift's answer is the same; left alone, boxes creep a fifth less.
        iterations: of the contact solver per time step; 50 is PyBullet's default.

    Raises:
        ModuleNotFoundError: PyBullet is not installed.
    """

    def __init__(
        self,
        time_step: float = TIME_STEP,
        maximal_coordinates: bool = True,
        iterations: int = ITERATIONS,
    ) -> None:
        self.time_step, self._iterations = time_step, iterations
        self._maximal = maximal_coordinates
        _import_pybullet()
        self._client = pybullet.connect(pybullet.DIRECT)
        self._disconnect = weakref.finalize(self, pybullet.disconnect, self._client)
        self._set_up()

    def _set_up(self) -> None:
        self._shapes: dict[tuple[float, ...], int] = {}
        self.bodies = 0
        pybullet.setGravity(0, 0, -task.GRAVITY, physicsClientId=self._client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=self.time_step,
            numSolverIterations=self._iterations,
            deterministicOverlappingPairs=1,
            physicsClientId=self._client,
        )

    def clear(self) -> None:
        """Take everything out; the next bodies behave, to the bit, as in a new world."""
        pybullet.resetSimulation(physicsClientId=self._client)
        self._set_up()

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
            position: (3,) centre in m.
            size: (3,) edge lengths in m.
            mass: kg.
            orientation: (4,) quaternion x, y, z, w.
            friction: of its surface; Bullet multiplies it with the other body's.
        """
        self.bodies += 1
        body = pybullet.createMultiBody(
            mass,
            self._shape(tuple(map(float, size))),
            basePosition=position,
            baseOrientation=orientation,
            useMaximalCoordinates=self._maximal,
            physicsClientId=self._client,
        )
        # Friction and damping are stated, because PyBullet's own differ between kinds of bodies.
        pybullet.changeDynamics(
            body,
            -1,
            lateralFriction=friction,
            linearDamping=DAMPING,
            angularDamping=DAMPING,
            physicsClientId=self._client,
        )
        return body

    def _shape(self, size: tuple[float, ...]) -> int:
        if size not in self._shapes:
            self._shapes[size] = pybullet.createCollisionShape(
                pybullet.GEOM_BOX,
                halfExtents=[edge / 2 for edge in size],
                physicsClientId=self._client,
            )
        return self._shapes[size]

    def remove(self, body: int) -> None:
        """Take a body out of the world; its number is not given again."""
        pybullet.removeBody(body, physicsClientId=self._client)

    def place(self, body: int, position, orientation=UPRIGHT) -> None:
        """Put a body at rest at ``position`` (m) with ``orientation`` (quaternion x, y, z, w)."""
        # This call also sets the velocities to zero.
        pybullet.resetBasePositionAndOrientation(
            body, position, orientation, physicsClientId=self._client
        )

    def pose(self, body: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Position (m) and orientation (quaternion x, y, z, w) of a body."""
        return pybullet.getBasePositionAndOrientation(body, physicsClientId=self._client)

    def velocity(self, body: int) -> tuple[float, float, float]:
        """Velocity of a body's centre, m/s."""
        return pybullet.getBaseVelocity(body, physicsClientId=self._client)[0]

    def step(self, seconds: float) -> None:
        """Let time pass, rounded to whole time steps."""
        for _ in range(self._steps(seconds)):
            pybullet.stepSimulation(physicsClientId=self._client)

    def _steps(self, seconds: float) -> int:
        return round(seconds / self.time_step)

    def pull(
        self, body: int, force: float = task.PICK_FORCE, seconds: float = task.LIFT_TIME
    ) -> float:
        """Pull a body upwards at its centre of mass (Sec. III-C).

        Args:
            body: which one.
            force: N.
            seconds: how long, rounded to whole time steps.

        Returns:
            How far the body moved, in m.
        """
        start = np.array(self.pose(body)[0])
        for _ in range(self._steps(seconds)):
            self.push(body, (0, 0, force))
        return float(np.linalg.norm(np.array(self.pose(body)[0]) - start))

    def push(self, body: int, force: tuple[float, float, float]) -> None:
        """Let one time step pass, in which ``force``, in N, acts at a body's centre of mass."""
        # PyBullet forgets the force after a step, therefore it is applied anew before each.
        pybullet.applyExternalForce(
            body,
            -1,
            force,
            self.pose(body)[0],
            pybullet.WORLD_FRAME,
            physicsClientId=self._client,
        )
        pybullet.stepSimulation(physicsClientId=self._client)

    def stop(self, body: int) -> None:
        """Take from a body its velocity along x, and leave it all else."""
        linear, angular = pybullet.getBaseVelocity(body, physicsClientId=self._client)
        pybullet.resetBaseVelocity(body, (0, *linear[1:]), angular, physicsClientId=self._client)

    def scan(
        self, eye, target, width: int, height: int, angle: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """What a depth camera at ``eye`` (m) sees towards ``target`` (m).

        Args:
            eye, target: (3,) m.
            width, height: pixels.
            angle: of view from the lower to the upper edge, degrees.

        Returns:
            ``depth`` (height, width) float64, m along the optical axis, and ``bodies``
            (height, width) int64, the body in each pixel, -1 where there is none.
        """
        _, _, _, depth, bodies = pybullet.getCameraImage(
            width,
            height,
            pybullet.computeViewMatrix(eye, target, (0, 0, 1)),
            pybullet.computeProjectionMatrixFOV(angle, width / height, NEAR_PLANE, FAR_PLANE),
            renderer=pybullet.ER_TINY_RENDERER,
            physicsClientId=self._client,
        )
        depth = np.reshape(depth, (height, width)).astype(np.float64)
        # The buffer holds the depth of a perspective lens, from 0 to 1.
        depth = FAR_PLANE * NEAR_PLANE / (FAR_PLANE - (FAR_PLANE - NEAR_PLANE) * depth)
        return depth, np.reshape(bodies, (height, width)).astype(np.int64)

    def close(self) -> None:
        """Disconnect the client; may be called again."""
        self._disconnect()
