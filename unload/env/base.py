"""What the two environments share: spaces, settings, and the order of calls."""

import gymnasium
import numpy as np
from gymnasium.error import ClosedEnvironmentError, ResetNeeded

from unload import task
from unload.env import observation
from unload.env.equalization import TIES, equalize
from unload.support import checks, random_state


class PickingEnv(gymnasium.Env):
    """Base of environments whose action picks one of the 128 observed items.

    Subclasses set ``_state`` to ``"running"`` in ``reset`` and to ``"finished"`` at an
    episode's end.
    """

    def __init__(
        self,
        equalize: bool,
        ties: str,
        max_picks: int,
        position_noise: float,
        render_mode: str | None,
    ) -> None:
        self.equalize = checks.boolean("equalize", equalize)
        checks.one_of("ties", ties, TIES)
        checks.one_of("render_mode", render_mode, (None, *self.metadata["render_modes"]))
        self.ties = ties
        self.max_picks = checks.integer("max_picks", max_picks, 1)
        self.position_noise = checks.real("position_noise", position_noise, 0)
        self.render_mode = render_mode
        self.observation_space = gymnasium.spaces.Box(-1, 1, (task.N_VISIBLE, 3), np.float32)
        self.action_space = gymnasium.spaces.Discrete(task.N_VISIBLE)
        self._state = "not started"

    def close(self) -> None:
        """Free what the environment holds; may be called again."""
        self._state = "closed"

    def _features(self, positions: np.ndarray) -> np.ndarray:
        """The observation of up to 128 items at ``positions`` (n, 3) in m, nearest first.

        Equalized if asked for, and padded.
        """
        seen = np.full((task.N_VISIBLE, 3), observation.PADDING, np.float32)
        seen[: len(positions)] = observation.scaled(positions)
        if not self.equalize:
            return seen
        present = np.arange(task.N_VISIBLE) < len(positions)
        return equalize(seen, self.ties, present=present)

    def _drift(self, count: int) -> np.ndarray:
        return observation.drift(count, self.position_noise, self.np_random)

    def _rng_state(self) -> np.ndarray:
        """The state of ``np_random`` as a plain array."""
        return np.array(random_state.to_text(self.np_random))

    def _row(self, action: int) -> int:
        if isinstance(action, np.ndarray) and action.ndim == 0:
            action = action.item()  # what Stable-Baselines3's predict returns
        return checks.integer("action", action, 0, task.N_VISIBLE - 1)

    def _check_open(self) -> None:
        if self._state == "closed":
            raise ClosedEnvironmentError("the environment is closed; make a new one")

    def _check_running(self) -> None:
        self._check_open()
        if self._state != "running":
            raise ResetNeeded(f"the episode is {self._state}; call reset first")

    def _check_started(self) -> None:
        self._check_open()
        if self._state == "not started":
            raise ResetNeeded("the episode is not started; call reset first")
