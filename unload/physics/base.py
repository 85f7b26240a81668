"""The interface of the three physics, which lift items with PyBullet or MuJoCo.

All have ``reset(load)``, ``lift(item)``, ``remove(item)``, ``positions()`` and ``close()``.
``lift`` returns how far the item moved; it is unloaded if that is at least
``task.LIFT_THRESHOLD``.
"""

from abc import ABC, abstractmethod

import numpy as np

from unload.load.boxes import Load, check_load
from unload.physics.bullet import World
from unload.support import checks


class Physics(ABC):
    """A container whose items can be lifted.

    Attributes:
        restores: True where a lift leaves all other boxes exactly where they were.
        load: the load, None before the first ``reset``.
        present: (n,) bool, False for items that have been removed.

    Raises:
        RuntimeError: a method is called before ``reset`` or after ``close``.
        TypeError: the load is not a ``Load``, or the item is no integer.
        ValueError: the item does not exist or has been removed.
    """

    restores = True

    def __init__(self) -> None:
        self.load: Load | None = None
        self.present = np.zeros(0, dtype=bool)
        self._closed = False
        self._world: World | None = None  # started when it is first needed

    def reset(self, load: Load) -> None:
        """Fill the container with ``load``."""
        check_load(load)
        self._check_open()
        self.load = None  # until it is filled: nothing may be lifted in a half-filled container
        self.present = np.ones(len(load), dtype=bool)
        self._reset(load)
        self.load = load

    def lift(self, item: int) -> float:
        """Try to lift an item; return how far it moved, in m (Sec. III-C, appendix)."""
        return self._lift(self._check(item))

    def remove(self, item: int) -> None:
        """Take an item out of the container."""
        item = self._check(item)
        self.present[item] = False
        self._remove(item)

    def positions(self) -> np.ndarray:
        """(n, 3) float64, the centre of each item in m; removed items keep their last one."""
        self._check_filled()
        return self.load.positions

    def close(self) -> None:
        """Free the simulator; may be called again."""
        self._closed = True
        self._stop()

    def _stop(self) -> None:
        if self._world is not None:
            self._world.close()
            self._world = None

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
    def _reset(self, load: Load) -> None: ...

    @abstractmethod
    def _lift(self, item: int) -> float: ...

    def _remove(self, item: int) -> None: ...
