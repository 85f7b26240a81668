"""The hyperparameter-tuning environment: choose the highest item (Sec. IV-A)."""

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from unload import task
from unload.env import observation
from unload.env.base import PickingEnv, PickingVectorEnv
from unload.env.equalization import equalize
from unload.env.observation import drift, scale
from unload.load.substacks import COLUMNS, ROWS, WALLS, build_load

_HEIGHT_TOLERANCE = 1e-6  # m, places this close are at the same height
# Every place that an item of a load can take: the walls of variant 0, 1 and 2 together.
GRID = np.concatenate(
    [build_load(np.full((WALLS, ROWS, len(COLUMNS)), variant)).positions for variant in range(3)]
)


class HighestItemVectorEnv(PickingVectorEnv):
    """``unload/HighestItem-v0``, many at once. See ``HighestItemEnv``."""

    def __init__(self, num_envs: int = task.NUM_ENVS, **settings) -> None:
        super().__init__(num_envs, **settings)
        self._observations = np.zeros(self.observation_space.shape, np.float32)
        self._highest = np.zeros((self.num_envs, task.N_VISIBLE), bool)

    def _fill(self, envs: np.ndarray, rngs: list[np.random.Generator]) -> None:
        # Each environment draws from a generator of its own.
        shape = len(rngs), task.N_VISIBLE
        exact, noise = np.empty((*shape, 3)), np.empty((*shape, 3))
        for number, rng in enumerate(rngs):
            exact[number] = GRID[rng.integers(len(GRID), size=task.N_VISIBLE)]
            noise[number] = drift(task.N_VISIBLE, self.position_noise, rng)

        # The rest is done for all environments at once.
        positions = (exact + noise).reshape(-1, 3)
        order = observation.distance(positions).reshape(shape).argsort(axis=1, kind="stable")
        rows = order[:, :, np.newaxis]
        seen = np.take_along_axis(scale(positions).reshape(*shape, 3), rows, axis=1)
        self._observations[envs] = equalize(seen, self.ties) if self.equalize else seen
        heights = np.take_along_axis(exact[..., 2], order, axis=1)
        highest = heights.max(axis=1, keepdims=True)
        self._highest[envs] = heights > highest - _HEIGHT_TOLERANCE

    def _pick(
        self, actions: np.ndarray, playing: np.ndarray
    ) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        rewards = np.where(self._highest[np.arange(self.num_envs), actions], 1.0, -1.0)
        envs = np.flatnonzero(playing)
        self._fill(envs, [self._rngs[env] for env in envs])
        return rewards, {}

    def state_dict(self) -> dict[str, Any]:
        return super().state_dict() | {"observations": self._observations, "highest": self._highest}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        super().load_state_dict(state)
        self._observations[:], self._highest[:] = state["observations"], state["highest"]

    def _emptied(self) -> np.ndarray:
        return np.zeros(self.num_envs, bool)  # there are always 128 items

    def _copy_observations(self) -> np.ndarray:
        return self._observations.copy()

    def _infos(self) -> dict[str, np.ndarray]:
        shape = (self.num_envs, task.N_VISIBLE)
        return {name: np.ones(shape, np.int8) for name in ("action_mask", "item_mask")}


class HighestItemEnv(PickingEnv):
    """Choose the item with the highest z among random ones on the grid of a load.

    ## Description
    At each step 128 items are put at random places that a load's items can take, with noise
    as in ``unload/Container-v0``. There is no physics: the environment finds
    hyperparameters quickly, for one picking rule that is optimal in the container, too.

    ## Action space
    ``Discrete(128)``: the row of the observation to pick.

    ## Observation space
    ``Box(-1, 1, (128, 3), float32)``: x, y, z of the items, nearest to the entrance
    first, scaled to the container; with ``equalize=True`` their equalized ranks instead.

    ## Rewards
    +1 if no item's place is higher than that of the chosen one, -1 else. On the grid
    several items, 12 on average, share the greatest height, and each of them counts: the
    noise is not a matter of the task.

    ## Starting state
    Random items. Every step shows new ones, whatever was chosen before.

    ## Episode end
    Truncation after ``max_picks`` picks; there is no termination.

    ## Information
    ``action_mask`` and ``item_mask``: (128,) int8, all 1, since no row fails twice or is empty.

    Arguments and errors are as for ``ContainerEnv``, but there is nothing to lift or to draw.
    """

    def __init__(self, *, render_mode: str | None = None, **settings) -> None:
        mode = AutoresetMode.DISABLED
        super().__init__(HighestItemVectorEnv(1, autoreset_mode=mode, **settings), render_mode)

    def render(self) -> None:
        """None: there is nothing to draw."""
        self._check_started()
