"""The hyperparameter-tuning environment: choose the highest item (Sec. IV-A)."""

import numpy as np

from unload import task
from unload.env import observation
from unload.env.base import AllOrReset, PickingEnv, check_options
from unload.load.substacks import COLUMNS, ROWS, WALLS, build_load

HEIGHT_TOLERANCE = 1e-6  # m, places this close are at the same height
# Every place that an item of a load can take: the walls of variant 0, 1 and 2 together.
GRID = np.concatenate(
    [build_load(np.full((WALLS, ROWS, len(COLUMNS)), variant)).positions for variant in range(3)]
)


def highest_places(places: np.ndarray) -> np.ndarray:
    """(..., items) bool, True where no other of the (..., items, 3) places in m is higher."""
    heights = places[..., 2]
    return heights > heights.max(axis=-1, keepdims=True) - HEIGHT_TOLERANCE


class HighestItemEnv(PickingEnv):
    """Choose the item with the highest z among random ones on the grid of a load.

    ## Description
    At each step 128 items are put at random places that a load's items can take, blurred
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
    blur is not a matter of the task.

    ## Starting state
    Random items. Every step shows new ones, whatever was chosen before.

    ## Episode end
    Truncation after ``max_picks`` picks; there is no termination.

    ## Information
    ``action_mask`` and ``item_mask``: (128,) int8, all 1, since no row fails twice or is empty.

    Arguments and errors are as for ``ContainerEnv``, but there is nothing to draw.
    """

    def reset(self, *, seed: int | None = None, options: dict | None = None):
        """Draw the first items. There are no options."""
        self._check_open()
        check_options(options, self.options)
        super().reset(seed=seed)
        with AllOrReset(self):
            self._picks, self._state = 0, "running"
            return self._draw(), self._info()

    def step(self, action: int):
        """Choose row ``action`` of the observation."""
        self._check_running()
        reward = 1.0 if self._highest[self._row(action)] else -1.0
        with AllOrReset(self):
            self._picks += 1
            truncated = self._picks == self.max_picks
            if truncated:
                self._state = "finished"
            return self._draw(), reward, False, truncated, self._info()

    def action_masks(self) -> np.ndarray:
        """(128,) bool, all True."""
        self._check_started()
        return np.ones(task.N_VISIBLE, dtype=bool)

    def render(self) -> None:
        """None: there is nothing to draw."""
        self._check_started()

    def _draw(self) -> np.ndarray:
        places = GRID[self.np_random.integers(len(GRID), size=task.N_VISIBLE)]
        positions = places + observation.drift(task.N_VISIBLE, self.position_noise, self.np_random)
        rows = observation.nearest(positions)
        self._highest = highest_places(places)[rows]
        return self._features(positions[rows])

    def _info(self) -> dict:
        return {name: np.ones(task.N_VISIBLE, np.int8) for name in ("action_mask", "item_mask")}
