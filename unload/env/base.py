"""The bases of single and vector environments: settings and order of calls.

``gymnasium.make_vec(id, num_envs)`` makes a vector environment. It behaves, bit for bit, as
Gymnasium's ``SyncVectorEnv`` of the single environments with the same arguments, ``physics`` and
``autoreset_mode`` included: same seeds, same actions, same observations, rewards, masks and infos.
A single one is a vector environment of one.

They are registered without Gymnasium's ``max_episode_steps``, which would wrap them and cut every
episode there, whatever their own ``max_picks`` is.
"""

import sys
from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from gymnasium.spaces import Box, Discrete
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from unload import task
from unload.env import observation
from unload.env.equalization import TIES
from unload.env.observation import MOST_NOISE
from unload.load.boxes import Load, check_supported
from unload.support import checks

_MOST_ENVS = 2**16  # several GB


def check_options(options: dict | None, known: tuple[str, ...]) -> dict[str, Load]:
    """Return the options of a ``reset``, {} for None; raise unless they are known, and loads."""
    options = {} if options is None else options
    checks.entries("options", options, ())
    for name, value in options.items():
        if name not in known:
            raise ValueError(f"options is {options!r}; expected {', '.join(known) or 'none'}")
        check_supported(value)
    return dict(options)


class InOrder:
    """Raises an error if methods are called out of order.

    Subclasses set ``_state`` to ``"not started"``, ``"running"``, ``"finished"`` or ``"closed"``,
    and to ``"broken off"`` while they change an episode; if that raises an error, it stays so. A
    ``PickingEnv`` has the state of its vector environment.
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


class EpisodeEnv(InOrder, gymnasium.Env):
    """Base of single environments."""

    def _row(self, action: int) -> int:
        if isinstance(action, np.ndarray) and action.ndim == 0:
            action = action.item()  # what Stable-Baselines3's predict returns
        return checks.integer("action", action, 0, self.observation_space.shape[0] - 1)


class PickingVectorEnv(InOrder, gymnasium.vector.VectorEnv):
    """Base of environments in which each action picks one of 128 visible items.

    Args:
        num_envs: number of environments.
        autoreset_mode: when the next episode begins in an environment whose own has ended, see
            ``step``; most of Gymnasium's vector wrappers want ``NEXT_STEP``. Gymnasium takes
            ``vector_kwargs`` only for its own ones:
            ``make_vec(id, num_envs, autoreset_mode=AutoresetMode.NEXT_STEP)``.
        equalize, ties, max_picks, position_noise: as for the single environment.
        render_mode: None; there are no pictures of vector environments.

    Attributes:
        options: names of the options that ``reset`` takes.
        autoreset_mode: TorchRL reads it here, Gymnasium in ``metadata``.

    Raises:
        TypeError, ValueError: an argument, a seed or actions are not as described.
        gymnasium.error.ResetNeeded: ``step`` before ``reset``, or after a call
            that raised an error half-way; ``step`` where an episode has ended, if ``DISABLED``.
        gymnasium.error.ClosedEnvironmentError: use after ``close``.
    """

    options: tuple[str, ...] = ()

    def __init__(
        self,
        num_envs: int = task.NUM_ENVS,
        autoreset_mode: AutoresetMode = AutoresetMode.SAME_STEP,
        equalize: bool = False,
        ties: str = "noise",
        max_picks: int = task.MAX_PICKS,
        position_noise: float = observation.POSITION_NOISE,
        render_mode: None = None,
    ) -> None:
        self.num_envs = checks.integer("num_envs", num_envs, 1, _MOST_ENVS)
        self.autoreset_mode = checks.one_of("autoreset_mode", autoreset_mode, AutoresetMode)
        self.equalize = checks.boolean("equalize", equalize)
        self.ties = checks.one_of("ties", ties, TIES)
        self.max_picks = checks.integer("max_picks", max_picks, 1, sys.maxsize)
        self.position_noise = checks.real("position_noise", position_noise, 0, MOST_NOISE)
        checks.one_of("render_mode", render_mode, (None,))

        self.metadata = {"render_modes": [], "autoreset_mode": self.autoreset_mode}
        self.single_observation_space = Box(-1, 1, (task.N_VISIBLE, 3), np.float32)
        self.single_action_space = Discrete(task.N_VISIBLE)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._rngs: list[Any] = [None] * self.num_envs  # a generator each, from the reset on
        self._picks = np.zeros(self.num_envs, np.int64)  # of each episode so far

    def reset(self, *, seed: int | Sequence[int | None] | None = None, options: dict | None = None):
        """Start an episode in every environment.

        Args:
            seed: environment i gets ``seed + i``, or ``seed[i]`` of a sequence; None lets
                the generators go on, or seeds them at random.
            options: as for the single environment, the same for all. They hold for these
                episodes, not for the next ones. ``reset_mask``, (num_envs,) bool, says in
                which environments; in the others their episodes go on.
        """
        self._check_open()
        # Gymnasium hands the mask over as an option; the rest of them is the same for all.
        chosen = np.ones(self.num_envs, bool)
        if isinstance(options, dict) and "reset_mask" in options:
            self._check_started()
            options = dict(options)
            mask = options.pop("reset_mask")
            chosen = checks.flag_array("options['reset_mask']", mask, chosen.shape)
        options = check_options(options, self.options)

        # One seed or None for each environment; None lets a generator go on that there is.
        if isinstance(seed, Sequence):
            seeds = [None if one is None else checks.integer("seed", one, 0) for one in seed]
            if len(seeds) != self.num_envs:
                raise ValueError(f"seed holds {len(seeds)} seeds; expected {self.num_envs}")
        elif seed is None:
            seeds = [None] * self.num_envs
        else:
            seeds = [checks.integer("seed", seed, 0) + env for env in range(self.num_envs)]
        rngs = list(self._rngs)
        for env in np.flatnonzero(chosen):
            if seeds[env] is not None or rngs[env] is None:
                rngs[env], _ = seeding.np_random(seeds[env])
        self._begin(chosen, rngs, **options)
        self._state = "running"
        return self._copy_observations(), _flagged(self._infos(), chosen)

    def step(self, actions: np.ndarray):
        """Pick row ``actions[i]``, (num_envs,) int, in environment i.

        Where an episode ends, the next one begins by ``autoreset_mode``:

            SAME_STEP  at once; ``infos["final_obs"]`` and ``["final_info"]`` hold the last ones
            NEXT_STEP  in the next step, whose action does not count there, and whose reward is 0
            DISABLED   by the caller's ``reset(options={"reset_mask": mask})``, before another step

        Where it begins in this step, the observation and infos are the reset's.
        """
        self._check_started()
        # Waiting for a reset: the episode ended in an earlier step. With SAME_STEP none ever waits.
        waiting = self._emptied() | (self._picks == self.max_picks)
        if waiting.any() and self.autoreset_mode is AutoresetMode.DISABLED:
            raise ResetNeeded("an episode is finished; call reset with a reset_mask first")
        last_row = task.N_VISIBLE - 1
        actions = checks.integer_array("actions", actions, (self.num_envs,), last_row)

        self._state = "broken off"  # until all is done
        rewards, picked = self._pick(actions, ~waiting)
        self._picks += 1

        # NEXT_STEP: where one waits, the next one begins, and the action has not counted.
        if waiting.any():
            rewards[waiting] = 0
            self._begin(waiting, self._rngs)
        terminations, truncations = self._emptied(), self._picks == self.max_picks

        # SAME_STEP: where one has ended by this pick, the next one begins at once, and what was
        # last seen of the old one goes aside.
        final: dict[str, Any] = {}
        ended = terminations | truncations
        if ended.any() and self.autoreset_mode is AutoresetMode.SAME_STEP:
            final = self._final_infos(ended, picked)
            self._begin(ended, self._rngs)

        # Fresh are those that have been reset in this step: their infos are a reset's, and those of
        # all others the pick's.
        fresh = ended if self.autoreset_mode is AutoresetMode.SAME_STEP else waiting
        infos = _flagged(self._infos(), np.ones(self.num_envs, bool))
        if not fresh.all():  # a reset has no infos about a pick
            infos |= _flagged(picked, ~fresh)
        self._state = "running"
        return self._copy_observations(), rewards, terminations, truncations, infos | final

    def _final_infos(self, ended: np.ndarray, picked: dict[str, np.ndarray]) -> dict[str, Any]:
        """What the last pick of ``ended`` episodes, (num_envs,) bool, showed, as in Gymnasium."""
        observations, last = np.full(self.num_envs, None), self._copy_observations()
        for env in np.flatnonzero(ended):
            observations[env] = last[env]
        infos = _flagged(self._infos() | picked, ended)
        return {
            "final_obs": observations, "_final_obs": ended,
            "final_info": infos, "_final_info": ended,
        }  # fmt: skip

    def action_masks(self) -> np.ndarray:
        """(num_envs, 128) bool, False for rows without a box, or failed since the last success."""
        self._check_started()
        return self._infos()["action_mask"].astype(bool)

    def _begin(self, where: np.ndarray, rngs: list[np.random.Generator], **options) -> None:
        """Begin an episode in some environments, (num_envs,) bool, by the generators of all.

        Whoever calls this sets the state to ``"running"`` when all is done.
        """
        self._state = "broken off"
        self._picks[where] = 0
        envs = np.flatnonzero(where)
        self._fill(envs, [rngs[env] for env in envs], **options)
        self._rngs = rngs

    def close_extras(self, **kwargs) -> None:
        """Free what the environments hold."""
        self._state = "closed"

    def state_dict(self) -> dict[str, Any]:
        """What a checkpoint keeps: arrays and what JSON can hold, not copied.

        A subclass that remembers more extends this method and ``load_state_dict``.
        """
        generators = [rng.bit_generator.state for rng in self._rngs]
        return {"generators": generators, "picks": self._picks}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go on from what ``state_dict`` returned; the environments have been reset before."""
        for rng, generator in zip(self._rngs, state["generators"], strict=True):
            rng.bit_generator.state = generator
        self._picks[:] = state["picks"]

    @abstractmethod
    def _fill(self, envs: np.ndarray, rngs: list[np.random.Generator], **options) -> None:
        """Put fresh items into some environments, (k,) int64, drawn from the generator of each."""

    @abstractmethod
    def _pick(
        self, actions: np.ndarray, playing: np.ndarray
    ) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Carry out checked actions where an environment is ``playing``, (num_envs,) bool.

        What is done in the others does not count, because they are filled next.

        Returns:
            The rewards, (num_envs,) float64, and the infos of ``step`` only.
        """

    @abstractmethod
    def _emptied(self) -> np.ndarray:
        """(num_envs,) bool, True where the last item has been unloaded."""

    @abstractmethod
    def _copy_observations(self) -> np.ndarray:
        """The observations as a fresh array, (num_envs, 128, 3) float32."""

    @abstractmethod
    def _infos(self) -> dict[str, np.ndarray]:
        """The infos of ``reset`` and ``step``, without Gymnasium's flags."""


def _flagged(infos: dict[str, np.ndarray], where: np.ndarray) -> dict[str, np.ndarray]:
    """Infos of some environments, (num_envs,) bool, 0 elsewhere, with Gymnasium's flags."""
    if not where.all():
        infos = {name: values.copy() for name, values in infos.items()}
        for values in infos.values():
            values[~where] = 0
    return infos | {f"_{name}": where for name in infos}


class PickingEnv(EpisodeEnv):
    """A single environment: a vector environment of one, without its first axis.

    Args:
        envs: a vector environment of one, with ``AutoresetMode.DISABLED``.
        render_mode: one of ``metadata["render_modes"]``, or None.
    """

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(self, envs: PickingVectorEnv, render_mode: str | None) -> None:
        checks.one_of("render_mode", render_mode, (None, *self.metadata["render_modes"]))
        self.render_mode, self.max_picks, self._envs = render_mode, envs.max_picks, envs
        self.observation_space = envs.single_observation_space
        self.action_space = envs.single_action_space

    def reset(self, *, seed: int | None = None, options: dict | None = None):
        """Begin an episode; a container takes ``options={"load": load}``, the load to use."""
        self._check_open()
        options = check_options(options, self._envs.options)
        super().reset(seed=seed)
        self._envs._begin(np.ones(1, bool), [self.np_random], **options)
        self._envs._state = "running"
        return self._envs._copy_observations()[0], _first(self._envs._infos())

    def step(self, action: int):
        """Pick row ``action`` of the observation."""
        self._check_running()
        row = np.array([self._row(action)])
        observations, rewards, terminations, truncations, infos = self._envs.step(row)
        terminated, truncated = bool(terminations[0]), bool(truncations[0])
        if terminated or truncated:
            self._envs._state = "finished"
        return observations[0], float(rewards[0]), terminated, truncated, _first(infos)

    def action_masks(self) -> np.ndarray:
        """(128,) bool, False for rows without a box or failed since the last successful pick."""
        return self._envs.action_masks()[0]

    def close(self) -> None:
        """Free what the environment holds; may be called again."""
        self._envs.close()

    @property
    def _state(self) -> str:
        return self._envs._state


def _first(infos: dict[str, np.ndarray]) -> dict[str, Any]:
    """The infos of the first environment, without Gymnasium's flags."""
    return {name: values[0] for name, values in infos.items() if not name.startswith("_")}
