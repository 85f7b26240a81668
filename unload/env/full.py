"""A container whose every box is simulated: what ``ContainerEnv`` does otherwise then."""

from typing import Any

import numpy as np

from unload.env.vector import ContainerVectorEnv
from unload.load.boxes import Load, check_supported
from unload.physics.full import FullPhysics


class FullContainer(ContainerVectorEnv):
    """A single container, lifted by a ``FullPhysics`` that is filled and emptied along with it.

    Args:
        physics: what is filled.
        settings: of ``ContainerVectorEnv``, without a physics.
    """

    def __init__(self, physics: FullPhysics, settings: dict[str, Any]) -> None:
        super().__init__(1, "local", **settings)  # "local" is replaced in the next line
        self.physics = physics

    @property
    def _drifts(self) -> bool:
        """Whether a lift may leave other boxes elsewhere. Then they are seen where they are."""
        return self.physics.after_pick == "keep"

    def _check(self, load: Load, name: str) -> None:
        check_supported(load, name)  # which may have overhangs

    def _fill(
        self, envs: np.ndarray, rngs: list[np.random.Generator], load: Load | None = None
    ) -> None:
        super()._fill(envs, rngs, load)
        (filled,) = self._loads
        self.physics.reset(filled)
        self._failed = np.zeros(len(filled), bool)
        if self._drifts:
            self._show(0, np.arange(len(filled)), self.physics.positions(), filled)

    def _lift(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        item = int(self._containers.visible[0, actions[0]])
        # A row without a box is a failed pick that asks no physics.
        distance = self.physics.lift(item) if item >= 0 else 0.0
        return np.array([item]), np.array([distance])

    def _pick(
        self, actions: np.ndarray, playing: np.ndarray
    ) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        rewards, picked = super()._pick(actions, playing)
        item = int(picked["item"][0])
        if rewards[0] > 0:
            self.physics.remove(item)
            self._failed[:] = False
        elif item >= 0:
            self._failed[item] = True

        # Where boxes may have moved, all are seen anew. This clears the mask, so what has failed
        # is masked again.
        if self._drifts:
            left = np.flatnonzero(self._present(0))
            self._show(0, left, self.physics.positions(), self._loads[0])
            visible = self._containers.visible[0, : len(left)]  # behind them there may be no box
            self._containers.masks[0, : len(visible)] &= ~self._failed[visible]
        return rewards, picked

    def liftable(self) -> np.ndarray:
        self._check_started()
        if self._drifts:
            raise ValueError("lifts move other boxes; expected a physics that restores them")
        return super().liftable()
