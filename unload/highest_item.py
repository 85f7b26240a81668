"""The hyperparameter-tuning environment: choose the highest item (Sec. IV-A)."""

import json

import numpy as np

from unload import observation, task
from unload.picking import POSITION_NOISE, PickingEnv
from unload.substacks import COLUMNS, ROWS, WALLS, build_load

# Every place that an item of a load can take: the walls of variant 0, 1 and 2 together.
GRID = np.concatenate(
    [build_load(np.full((WALLS, ROWS, len(COLUMNS)), variant)).positions for variant in range(3)]
)


class HighestItemEnv(PickingEnv):
    """Choose the item with the highest z among random ones on the grid of a load.

    ## Description
    At each step 128 items are put at random places that a load's items can take, blurred
    as in ``unload/Container-v0``, so that one of them is the highest. There is no physics:
    the environment finds hyperparameters quickly, for one picking rule that is optimal.

    ## Action space
    ``Discrete(128)``: the row of the observation to pick.

    ## Observation space
    ``Box(-1, 1, (128, 3), float32)``: x, y, z of the items, nearest to the entrance
    first, scaled to the container; with ``equalize=True`` their equalized ranks instead.

    ## Rewards
    +1 if the chosen item has the highest z, -1 if not.

    ## Starting state
    Random items. Every step shows new ones, whatever was chosen before.

    ## Episode end
    Truncation after ``max_picks`` picks; there is no termination.

    ## Information
    ``action_mask``: (128,) int8, all 1, since no row fails twice.

    Args:
        equalize: give equalized observations (Alg. 1).
        ties: see ``unload.equalize``.
        max_picks: length of an episode.
        position_noise: standard deviation of the blur in m. With 0, several items may be
            highest, and the first of them counts.
        render_mode: None; there is nothing to draw.

    Raises:
        TypeError, ValueError: an argument or an action is not as described.
        gymnasium.error.ResetNeeded: ``step`` before ``reset`` or after the episode's end.
        gymnasium.error.ClosedEnvironmentError: use after ``close``.
    """

    metadata = {"render_modes": []}

    def __init__(
        self,
        equalize: bool = False,
        ties: str = "noise",
        max_picks: int = task.MAX_PICKS,
        position_noise: float = POSITION_NOISE,
        render_mode: None = None,
    ) -> None:
        super().__init__(equalize, ties, max_picks, position_noise, render_mode)

    def reset(self, *, seed: int | None = None, options: dict | None = None):
        """Draw the first items. There are no options."""
        self._check_open()
        if options:
            raise ValueError(f"options is {options!r}; expected none")
        super().reset(seed=seed)
        self._picks, self._state = 0, "running"
        return self._draw(), self._info()

    def step(self, action: int):
        """Choose row ``action`` of the observation."""
        self._check_running()
        reward = 1.0 if self._row(action) == self._highest else -1.0
        self._picks += 1
        truncated = self._picks == self.max_picks
        if truncated:
            self._state = "finished"
        return self._draw(), reward, False, truncated, self._info()

    def action_masks(self) -> np.ndarray:
        """(128,) bool, all True."""
        return np.ones(task.N_VISIBLE, dtype=bool)

    def get_state(self) -> dict[str, np.ndarray]:
        """All that ``set_state`` needs to go on from here, as plain arrays."""
        self._check_started()
        return {
            "counts": np.array([self._picks, self._highest]),
            "rng": np.array(json.dumps(self.np_random.bit_generator.state)),
        }

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        """Go on from what ``get_state`` returned, here or in another environment."""
        self._check_open()
        self._picks, self._highest = state["counts"].tolist()
        self.np_random.bit_generator.state = json.loads(str(state["rng"]))
        self._state = "finished" if self._picks == self.max_picks else "running"

    def _draw(self) -> np.ndarray:
        positions = GRID[self.np_random.integers(len(GRID), size=task.N_VISIBLE)]
        positions = positions + self._drift(task.N_VISIBLE)
        scaled = observation.scale(positions[observation.nearest(positions)])
        self._highest = int(np.argmax(scaled[:, 2]))
        return self._features(scaled)

    def _info(self) -> dict:
        return {"action_mask": np.ones(task.N_VISIBLE, dtype=np.int8)}
