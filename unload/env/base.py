"""The base of the two environments: spaces, settings, and the order of calls."""

import sys

import gymnasium
import numpy as np
from gymnasium.error import ClosedEnvironmentError, ResetNeeded

from unload import task
from unload.env import observation
from unload.env.equalization import TIES, equalize
from unload.support import checks, random_state


def check_settings(
    equalize: bool, ties: str, max_picks: int, position_noise: float
) -> tuple[bool, str, int, float]:
    """Return the settings that all environments have, as Python's own types.

    Raises:
        TypeError, ValueError: one of them is not as ``ContainerEnv`` describes it.
    """
    checks.one_of("ties", ties, TIES)
    return (
        checks.boolean("equalize", equalize),
        ties,
        checks.integer("max_picks", max_picks, 1, sys.maxsize),
        checks.real("position_noise", position_noise, 0, observation.MOST_NOISE),
    )


class AllOrReset:
    """Context manager that requires a reset of ``env`` if its block raises.

    A class, because ``contextlib.contextmanager`` is three times as slow, and steps are short.
    """

    def __init__(self, env: object) -> None:
        self._env = env

    def __enter__(self) -> None: ...

    def __exit__(self, kind: type | None, error: object, trace: object) -> None:
        if kind is not None:
            self._env._state = "broken off"


class EpisodeEnv(gymnasium.Env):
    """Base of environments that refuse calls out of order.

    Subclasses set ``_state`` to ``"not started"``, ``"running"``, ``"finished"``, ``"closed"``;
    ``AllOrReset`` sets it to ``"broken off"``.
    """

    _state = "not started"

    def _check_open(self) -> None:
        if self._state == "closed":
            raise ClosedEnvironmentError("the environment is closed; make a new one")

    def _check_started(self) -> None:
        self._check_open()
        if self._state in ("not started", "broken off"):
            raise ResetNeeded(f"the episode is {self._state}; call reset first")

    def _check_running(self) -> None:
        self._check_started()
        if self._state == "finished":
            raise ResetNeeded("the episode is finished; call reset first")


class PickingEnv(EpisodeEnv):
    """Base of environments whose action picks one of the 128 visible items.

    Subclasses set ``_state`` to ``"running"`` in ``reset`` and to ``"finished"`` at an
    episode's end. What changes the episode stands in ``AllOrReset``.
    """

    def __init__(
        self,
        equalize: bool,
        ties: str,
        max_picks: int,
        position_noise: float,
        render_mode: str | None,
    ) -> None:
        checked = check_settings(equalize, ties, max_picks, position_noise)
        self.equalize, self.ties, self.max_picks, self.position_noise = checked
        checks.one_of("render_mode", render_mode, (None, *self.metadata["render_modes"]))
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

    def _rng_state(self) -> np.ndarray:
        """The state of ``np_random`` as a plain array."""
        return np.array(random_state.to_text(self.np_random))

    def _set_rng_state(self, text: np.ndarray) -> None:
        """Let ``np_random`` go on from what ``_rng_state`` returned."""
        rng = np.random.default_rng()
        random_state.set_text(text, rng)
        self._np_random = rng

    def _row(self, action: int) -> int:
        if isinstance(action, np.ndarray) and action.ndim == 0:
            action = action.item()  # what Stable-Baselines3's predict returns
        return checks.integer("action", action, 0, task.N_VISIBLE - 1)
