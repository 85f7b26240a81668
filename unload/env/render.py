"""Pictures of a container by PyBullet's TinyRenderer."""

import numpy as np

from unload import task
from unload.load.boxes import Load
from unload.load.substacks import package_colour
from unload.physics.bullet import World
from unload.support import checks

EYE = (12.5, -2.0, 4.2)  # m
TARGET = (4.6, 1.25, 0.7)  # m
PICTURE_WIDTH, PICTURE_HEIGHT = 640, 480  # pixels
WALL_COLOUR = (0.82, 0.82, 0.8)


class Camera:
    """Looks into a container from outside its entrance.

    Bodies are kept between pictures: a new load builds them, removed items are taken away.
    """

    def __init__(self) -> None:
        self._load: Load | None = None
        self._world: World | None = None

    def picture(
        self, load: Load, present: np.ndarray, positions: np.ndarray | None = None
    ) -> np.ndarray:
        """(480, 640, 3) uint8, a picture of some items of a load, all of them upright.

        Args:
            load: the items.
            present: (n,) bool, which of them are drawn.
            positions: (n, 3) float, where their centres are in m; the load's if None.
        """
        positions = load.positions if positions is None else positions
        positions = checks.finite_array("positions", positions, (len(load), 3))
        if load is not self._load or any(
            self._bodies[item] is None for item in np.flatnonzero(present)
        ):
            self._build(load)
        for item in np.flatnonzero(~present):
            if self._bodies[item] is not None:
                self._world.remove(self._bodies[item])
                self._bodies[item] = None
        for item in np.flatnonzero(present):
            self._world.place(self._bodies[item], positions[item])
        return self._world.picture(EYE, TARGET, PICTURE_WIDTH, PICTURE_HEIGHT)

    def _build(self, load: Load) -> None:
        self.close()
        self._world = World()
        length, width, height = task.CONTAINER
        for position, size in (
            ((length / 2, width / 2, -0.05), (length, width, 0.1)),
            ((length / 2, width + 0.05, height / 2), (length, 0.1, height)),
            ((-0.05, width / 2, height / 2), (0.1, width, height)),
        ):
            self._world.paint(self._world.add_box(position, size, 0), WALL_COLOUR)
        self._bodies: list[int | None] = []
        for position, size, package in zip(load.positions, load.sizes, load.packages):
            # Drawn a little smaller, so that the seams between boxes show.
            body = self._world.add_box(position, np.maximum(size - 0.015, size / 2), 0)
            self._world.paint(body, package_colour(package))
            self._bodies.append(body)
        self._load = load

    def close(self) -> None:
        """Free the renderer; the next picture starts it again."""
        if self._world is not None:
            self._world.close()
            self._load = self._world = None
