"""What the two environments share: spaces, settings, and the order of calls."""

import gymnasium
import numpy as np
from gymnasium.error import ClosedEnvironmentError, ResetNeeded

from unload import checks, task
from unload.equalization import TIES, equalize

# Drift of the boxes of a settled full simulation, measured in notebook 04: how far they
# spread around the places they were put at, and how far they sink in the mean (m).
POSITION_NOISE = 0.0005
SINK = 0.001


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
        checks.one_of("equalize", equalize, (False, True))
        checks.one_of("ties", ties, TIES)
        checks.one_of("render_mode", render_mode, (None, *self.metadata["render_modes"]))
        self.equalize, self.ties = equalize, ties
        self.max_picks = checks.integer("max_picks", max_picks, 1)
        self.position_noise = checks.real("position_noise", position_noise, 0)
        self.render_mode = render_mode
        self.observation_space = gymnasium.spaces.Box(-1, 1, (task.N_VISIBLE, 3), np.float32)
        self.action_space = gymnasium.spaces.Discrete(task.N_VISIBLE)
        self._state = "not started"

    def close(self) -> None:
        """Free what the environment holds; may be called again."""
        self._state = "closed"

    def _features(self, scaled: np.ndarray) -> np.ndarray:
        """A new observation from scaled positions, equalized if asked for."""
        return equalize(scaled, self.ties) if self.equalize else scaled.copy()

    def _drift(self, count: int) -> np.ndarray:
        """(count, 3) float64, how far a simulator's boxes are from where they were put, m."""
        drift = self.np_random.normal(0, self.position_noise, (count, 3))
        if self.position_noise:
            drift[:, 2] -= SINK
        return drift

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
