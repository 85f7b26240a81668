"""The base of the array environments: episodes, seeds and states.

``gymnasium.make_vec(id, num_envs)`` makes them. Each behaves, bit for bit, as Gymnasium's
``SyncVectorEnv`` of the single environments with autoreset in the same step: same seeds,
same actions, same observations, rewards, masks and infos. Each environment begins its next
episode when its own has ended.
"""

from abc import abstractmethod
from collections import deque
from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from unload import task
from unload.env.base import AllOrReset, check_settings
from unload.env.equalization import TIE_TOLERANCE
from unload.env.observation import POSITION_NOISE
from unload.support import checks, random_state

MOST_ENVS = 2**16  # several GB


class PickingVectorEnv(gymnasium.vector.VectorEnv):
    """Base of environments in which each action picks one of 128 visible items.

    Args:
        num_envs: number of environments.
        equalize, ties, max_picks, position_noise: as for the single environment.
        render_mode: None; there are no pictures of many containers.

    Raises:
        TypeError, ValueError: an argument, a seed or actions are not as described.
        gymnasium.error.ResetNeeded: ``step`` or ``get_state`` before ``reset``, or after a
            ``step`` or ``set_state`` that raised an error half-way.
        gymnasium.error.ClosedEnvironmentError: use after ``close``.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.SAME_STEP}

    def __init__(
        self,
        num_envs: int = task.NUM_ENVS,
        equalize: bool = False,
        ties: str = "noise",
        max_picks: int = task.MAX_PICKS,
        position_noise: float = POSITION_NOISE,
        render_mode: None = None,
    ) -> None:
        self.num_envs = checks.integer("num_envs", num_envs, 1, MOST_ENVS)
        checked = check_settings(equalize, ties, max_picks, position_noise)
        self.equalize, self.ties, self.max_picks, self.position_noise = checked
        checks.one_of("render_mode", render_mode, (None,))
        shape = (task.N_VISIBLE, 3)
        self.single_observation_space = gymnasium.spaces.Box(-1, 1, shape, np.float32)
        self.single_action_space = gymnasium.spaces.Discrete(task.N_VISIBLE)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._features = (self.equalize, ties == "average", np.float32(TIE_TOLERANCE))
        self._state = "not started"
        self._rngs: list[np.random.Generator] = []
        self._starts = [""] * self.num_envs  # the generators' states before each episode's reset
        # Of each episode so far. An environment that waits for others counts up to 0.
        self._picks = np.zeros(self.num_envs, np.int64)
        # The last actions, (num_envs,) each: no episode is longer.
        self._actions: deque[np.ndarray] = deque(maxlen=self.max_picks)

    def reset(self, *, seed: int | Sequence[int | None] | None = None, options=None):
        """Start an episode in every environment. There are no options.

        If one of them cannot start, the episodes and the generators stay as they were.

        Args:
            seed: environment i gets ``seed + i``, or ``seed[i]`` of a sequence; None lets
                the generators go on, or seeds them at random.
        """
        self._check_open()
        if options:
            raise ValueError(f"options is {options!r}; expected none")
        if seed is None:
            seeds = [None] * self.num_envs
        elif isinstance(seed, Sequence):
            seeds = [None if one is None else checks.integer("seed", one, 0) for one in seed]
            if len(seeds) != self.num_envs:
                raise ValueError(f"seed holds {len(seeds)} seeds; expected {self.num_envs}")
        else:
            first = checks.integer("seed", seed, 0)
            seeds = range(first, first + self.num_envs)
        old = self._rngs or [None] * self.num_envs
        return self._restart(
            [
                rng if one is None and rng is not None else seeding.np_random(one)[0]
                for one, rng in zip(seeds, old)
            ]
        )

    def step(self, actions: np.ndarray):
        """Pick row ``actions[i]``, (num_envs,) int, in environment i.

        Where an episode ends, the next one begins: the observation and infos are the
        reset's, and ``infos["final_obs"]`` and ``infos["final_info"]`` hold the last ones.
        """
        self._check_started()
        actions = checks.integer_array("actions", actions, (self.num_envs,))
        if actions.min() < 0 or actions.max() >= task.N_VISIBLE:
            raise ValueError(
                f"actions holds {actions.min()} to {actions.max()}; "
                f"expected 0 to {task.N_VISIBLE - 1}"
            )
        with AllOrReset(self):
            return self._advance(actions)

    def _advance(self, actions: np.ndarray):
        """``step`` by checked actions; where one is -1, the environment waits."""
        self._actions.append(actions)
        rewards = self._pick(actions)
        self._picks += 1
        terminations = self._emptied()
        truncations = self._picks == self.max_picks
        observations, infos = self._look(), self._infos() | self._pick_infos()
        ended = terminations | truncations
        if ended.any():
            observations, infos = self._begin_next(ended, observations, infos)
        else:
            infos = _flagged(infos, ~ended)
        return observations, rewards, terminations, truncations, infos

    def _begin_next(self, ended: np.ndarray, last: np.ndarray, last_infos: dict[str, np.ndarray]):
        """Begin the next episode where one has ended; return ``step``'s observations and infos.

        Args:
            ended: (num_envs,) bool.
            last, last_infos: observations and infos after the pick in every environment.
        """
        envs = np.flatnonzero(ended)
        self._begin(envs, [self._rngs[env] for env in envs])
        infos = _flagged(self._infos(), np.ones(self.num_envs, bool))
        if not ended.all():  # a reset has no infos about a pick
            picks = {name: each for name, each in last_infos.items() if name not in infos}
            infos |= _flagged(_masked(picks, ~ended), ~ended)
        final = np.full(self.num_envs, None)
        for env in envs:
            final[env] = last[env]
        infos |= {"final_obs": final, "_final_obs": ended}
        final_infos = _flagged(_masked(last_infos, ended), ended)
        infos |= {"final_info": final_infos, "_final_info": ended}
        return self._look(), infos

    def get_state(self) -> dict[str, np.ndarray]:
        """All that ``set_state`` needs to go on from here.

        Returns:
            ``rng``: (num_envs,) str, the generators' states before each episode's reset, and
            ``actions``: (picks, num_envs) int64, the picks made since, the latest in the last
            row. -1 stands for picks before the environment's episode began.
        """
        self._check_started()
        steps = int(self._picks.max())
        latest = list(self._actions)[len(self._actions) - steps :]
        actions = np.array(latest, np.int64).reshape(steps, self.num_envs)
        actions[np.arange(steps)[:, np.newaxis] < steps - self._picks] = -1
        return {"rng": np.array(self._starts), "actions": actions}

    def set_state(self, state: dict[str, np.ndarray]):
        """Go on from what ``get_state`` returned, here or in another environment.

        The picks are repeated; they may be those of several episodes. An environment whose
        first actions are -1 waits for the others meanwhile.

        Returns:
            Observations and infos after the last of them.

        Raises:
            TypeError, ValueError: ``state`` is something else.
        """
        self._check_open()
        checks.entries("state", state, ("rng", "actions"))
        texts = np.array(state["rng"], object)
        if texts.shape != (self.num_envs,):
            raise ValueError(f"state['rng'] has shape {texts.shape}; expected ({self.num_envs},)")
        for text in texts:
            random_state.check_text("state['rng']", text)
        actions = checks.integer_array("state['actions']", state["actions"], (None, self.num_envs))
        if actions.size and not (-1 <= actions.min() and actions.max() < task.N_VISIBLE):
            raise ValueError(
                f"state['actions'] holds {actions.min()} to {actions.max()}; "
                f"expected 0 to {task.N_VISIBLE - 1}, or -1"
            )
        if (actions[1:] < 0)[actions[:-1] >= 0].any():
            raise ValueError("state['actions'] holds -1 after a pick; expected -1 before all picks")
        rngs = [np.random.default_rng() for _ in texts]
        for rng, text in zip(rngs, texts):
            random_state.set_text(text, rng)
        observations, infos = self._restart(rngs)
        with AllOrReset(self):
            self._picks -= (actions < 0).sum(axis=0)
            for row in actions:
                observations, _, _, _, infos = self._advance(row)
        return observations, infos

    def _restart(self, rngs: list[np.random.Generator]):
        """Begin an episode in every environment; return ``reset``'s observations and infos."""
        self._begin(np.arange(self.num_envs), rngs)
        self._rngs = rngs
        self._actions.clear()
        self._state = "running"
        return self._look(), _flagged(self._infos(), np.ones(self.num_envs, bool))

    def _begin(self, envs: np.ndarray, rngs: list[np.random.Generator]) -> None:
        """Begin an episode in each of these environments, or, if an error is raised, in none."""
        starts = [random_state.to_text(rng) for rng in rngs]
        with random_state.kept_on_error(rngs):
            drawn = self._draw(rngs)
        with AllOrReset(self):
            for env, start in zip(envs, starts):
                self._starts[env] = start
            self._picks[envs] = 0
            self._fill(envs, drawn)

    def _check_open(self) -> None:
        if self.closed:
            raise ClosedEnvironmentError("the environment is closed; make a new one")

    def _check_started(self) -> None:
        self._check_open()
        if self._state != "running":
            raise ResetNeeded(f"the episodes are {self._state}; call reset first")

    @abstractmethod
    def _draw(self, rngs: list[np.random.Generator]) -> Any:
        """Draw fresh items from each of k generators, and change nothing else."""

    @abstractmethod
    def _fill(self, envs: np.ndarray, drawn: Any) -> None:
        """Put what ``_draw`` returned into the environments of these numbers, (k,) int64."""

    @abstractmethod
    def _pick(self, actions: np.ndarray) -> np.ndarray:
        """Carry out checked actions that are not -1; return the rewards, (num_envs,) float64."""

    @abstractmethod
    def _emptied(self) -> np.ndarray:
        """(num_envs,) bool, True where the last item has been unloaded."""

    @abstractmethod
    def _look(self) -> np.ndarray:
        """The observations as a fresh array, (num_envs, 128, 3) float32."""

    @abstractmethod
    def _infos(self) -> dict[str, np.ndarray]:
        """The infos of ``reset`` and ``step``, without Gymnasium's flags."""

    def _pick_infos(self) -> dict[str, np.ndarray]:
        """The infos of ``step`` only."""
        return {}


def _flagged(infos: dict[str, np.ndarray], where: np.ndarray) -> dict[str, np.ndarray]:
    """Add Gymnasium's flags that say in which environments there are such infos."""
    return infos | {f"_{name}": where for name in infos}


def _masked(infos: dict[str, np.ndarray], where: np.ndarray) -> dict[str, np.ndarray]:
    """The infos of some environments, and 0 elsewhere."""
    infos = {name: values.copy() for name, values in infos.items()}
    for values in infos.values():
        values[~where] = 0
    return infos
