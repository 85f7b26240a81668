"""The environments of a training run, and the picks in them."""

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Discrete
from gymnasium.vector import AutoresetMode

from unload import task
from unload.agent.config import TrainConfig
from unload.agent.policies import choosable
from unload.env.base import PickingVectorEnv


class Rollout:
    """The environments of a run, at some point of it.

    Args:
        config: of the run.
        seed: of the environments.
        stack: makes the loads, see ``unload.train``.

    Attributes:
        envs: the environments.
        observations: (num_envs, 128, 3) float32, what is seen now.
        masks: (num_envs, 128) int8, ``info["action_mask"]``.
        allowed: (num_envs, 128) bool, what may be picked in training: rows that hold an item,
            with ``config.mask`` only those that have not failed, as long as there are some.
        steps: made so far; one pick in each environment per step.
    """

    def __init__(self, config: TrainConfig, seed: int, stack: Callable | None = None) -> None:
        self.steps = 0
        self._num_envs, self._all_picks = config.num_envs, config.picks
        self._mask, self._next_state = config.mask, config.gamma > 0
        own: dict[str, Any] = {} if stack is None else {"stack": stack}
        self.envs: Any = gymnasium.make_vec(
            config.env,
            config.num_envs,
            equalize=config.equalize,
            ties=config.ties,
            max_picks=config.max_picks,
            position_noise=config.position_noise,
            **own,
        )
        # Other kinds of environments have no ``state_dict`` for a checkpoint, and NEXT_STEP would
        # count a reset as a pick.
        mode = getattr(self.envs, "autoreset_mode", None)
        if not isinstance(self.envs, PickingVectorEnv) or mode is not AutoresetMode.SAME_STEP:
            kinds = "a ContainerVectorEnv or another PickingVectorEnv, in SAME_STEP"
            raise ValueError(f"env={config.env!r} makes {self.envs}; expected {kinds}")
        for space, wanted in (
            (self.envs.single_observation_space, Box(-1, 1, (task.N_VISIBLE, 3), np.float32)),
            (self.envs.single_action_space, Discrete(task.N_VISIBLE)),
        ):
            if space != wanted:
                raise ValueError(f"env={config.env!r} has {space}; expected {wanted}")
        self._observe(*self.envs.reset(seed=seed))

    def _observe(self, observations: np.ndarray, infos: dict[str, np.ndarray]) -> None:
        self.observations, self.masks = observations, infos["action_mask"]
        self._present = infos["item_mask"].astype(bool)
        masks = self.masks.astype(bool)
        self.allowed = choosable(masks, self._present) if self._mask else self._present

    @property
    def picks(self) -> int:
        """Picks so far, over all environments."""
        return self.steps * self._num_envs

    @property
    def finished(self) -> bool:
        """Whether all picks of the run have been made."""
        return self.picks == self._all_picks

    def deadlocked(self, actions: np.ndarray) -> np.ndarray:
        """Return which actions pick an item that failed since the last success, bool."""
        return self.masks[np.arange(len(actions)), actions] == 0

    def pick(self, actions: np.ndarray) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """Pick in every environment.

        Args:
            actions: (num_envs,) int64.

        Returns:
            What a ``ReplayBuffer`` holds of the picks, with the environment's ``rewards``; and
            how far each item was lifted, (num_envs,) float64 in m, NaN in a task without lifts.
        """
        seen = self.observations
        following, rewards, terminations, truncations, infos = self.envs.step(actions)
        picks = {"observations": seen, "actions": actions, "rewards": rewards}

        # Where an episode has ended, what its last pick led to stands in final_info and final_obs:
        # all else is of the next episode already.
        ended, last = terminations | truncations, infos.get("final_info", {})
        unknown = np.full(len(actions), np.nan)
        distances = np.where(ended, last.get("distance", unknown), infos.get("distance", unknown))
        if self._next_state:
            observations, masks = following.copy(), infos["action_mask"].astype(bool)
            present = infos["item_mask"].astype(bool)
            for env in np.flatnonzero(ended):
                observations[env] = infos["final_obs"][env]
                masks[env], present[env] = last["action_mask"][env], last["item_mask"][env]
            picks |= {
                "next_observations": observations,
                "next_masks": choosable(masks, present),
                "terminations": terminations,
            }
        self.steps += 1
        self._observe(following, infos)
        return picks, distances

    def state_dict(self) -> dict[str, Any]:
        """Return what a checkpoint keeps: the environments' state, and what is seen of them."""
        infos = {"action_mask": self.masks, "item_mask": self._present}
        seen = {"observations": self.observations, "infos": infos}
        return {"steps": self.steps, "envs": self.envs.state_dict(), **seen}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Take back what ``state_dict`` returned."""
        self.steps = state["steps"]
        self.envs.load_state_dict(state["envs"])
        self._observe(state["observations"], state["infos"])

    def close(self) -> None:
        """Free the environments."""
        self.envs.close()
