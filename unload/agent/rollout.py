"""The picks of a training run, and how the latest of them are repeated.

A checkpoint does not hold the replay memory, which is 1.6 GB in the paper's configuration.
The environments are deterministic, so it holds the state of their generators at the start of the
oldest episodes that the memory reaches back to, and the actions since: repeating these fills the
memory again, pick by pick as it was. Where the episodes never start all together, because their
loads are so small, the picks are repeated from the first one on.
"""

from collections import deque
from collections.abc import Callable, Iterator
from hashlib import blake2b
from typing import Any, cast

import gymnasium
import numpy as np

from unload.agent.config import TrainConfig
from unload.agent.replay import shuffle_places
from unload.env.base import PickingVectorEnv


class Rollout:
    """The environments of a run, and all its picks so far.

    Args:
        config: of the run.
        reach: picks that the replay memory holds, which a checkpoint must bring back.
        stack: makes the loads, see ``unload.train``.

    Attributes:
        observations: (num_envs, 128, 3) float32, what is seen now.
        masks: (num_envs, 128) int8, ``info["action_mask"]``.
        allowed: (num_envs, 128) bool, what may be picked in training: rows that hold an item,
            with ``config.mask`` only those that have not failed.
        steps: made so far; one pick in each environment per step.

    Raises:
        ValueError: ``stack`` does not follow its generator.
    """

    def __init__(self, config: TrainConfig, reach: int, stack: Callable | None = None) -> None:
        self._config, self._reach = config, reach
        # Every pick of the run; a row of the observation fits a byte.
        shape = (config.picks // config.num_envs, config.num_envs)
        self._actions = np.empty(shape, np.uint8)
        self.steps = 0
        options: dict[str, Any] = {} if stack is None else {"stack": stack}
        envs = gymnasium.make_vec(
            config.env,
            config.num_envs,
            equalize=config.equalize,
            ties=config.ties,
            max_picks=config.max_picks,
            position_noise=config.position_noise,
            **options,
        )
        self.envs = cast(PickingVectorEnv, envs)
        self._see(*self.envs.reset(seed=config.seeds()[0]))
        if stack is not None:
            first, second = (stack(np.random.default_rng(0)).positions for _ in range(2))
            if not np.array_equal(first, second):
                raise ValueError(
                    "stack made two different loads from generators in the same state; "
                    "expected the same"
                )
        # Of the episodes that the replay memory reaches back to, where all started together: first
        # step, generators there.
        self._starts = deque([(0, self.envs.starts())])

    def _see(self, observations: np.ndarray, infos: dict[str, np.ndarray]) -> None:
        self.observations, self.masks = observations, infos["action_mask"]
        self._present = infos["item_mask"].astype(bool)
        self.allowed = self.masks.astype(bool) if self._config.mask else self._present

    @property
    def picks(self) -> int:
        """Picks so far, over all environments."""
        return self.steps * self._config.num_envs

    @property
    def finished(self) -> bool:
        """Whether all picks of the run have been made."""
        return self.steps == len(self._actions)

    def deadlocked(self, actions: np.ndarray) -> np.ndarray:
        """Return which actions pick an item that failed since the last success, bool."""
        return self.masks[np.arange(len(actions)), actions] == 0

    def pick(self, actions: np.ndarray) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Pick in every environment.

        Args:
            actions: (num_envs,) int64.

        Returns:
            The rewards, (num_envs,), and what to add to a ``ReplayBuffer``.
        """
        following, rewards, terminations, truncations, infos = self.envs.step(actions)
        transitions = {
            "observations": self._stored_observations(),
            "actions": actions,
            "rewards": rewards,
        }
        if self._config.gamma > 0:
            transitions |= _next_states(following, terminations, infos)
        self._actions[self.steps] = actions
        self.steps += 1
        self._see(following, infos)
        if (terminations | truncations).all():
            self._starts.append((self.steps, self.envs.starts()))
            while (self.steps - self._starts[1][0]) * self._config.num_envs >= self._reach:
                self._starts.popleft()
        return rewards, transitions

    def _stored_observations(self) -> np.ndarray:
        """What is remembered of what is seen now."""
        config = self._config
        if not config.shuffle_places:
            return self.observations
        # By the pick's number, so that a resumed run draws the same permutation again.
        rng = np.random.default_rng((config.seed, self.picks))
        return shuffle_places(self.observations, rng, self._present)

    def digest(self) -> str:
        """Return a digest of what is seen now."""
        shown = self.observations.tobytes() + self.masks.tobytes()
        return blake2b(shown, digest_size=16).hexdigest()

    def state(self) -> dict[str, np.ndarray]:
        """Return what ``load_state`` needs to go on from here."""
        start, generators = self._starts[0]
        return {
            "generators": generators,
            "start": np.array(start),
            "actions": self._actions[start : self.steps],
            "digest": np.array(self.digest()),
        }

    def load_state(self, arrays: dict[str, np.ndarray]) -> Iterator[dict[str, np.ndarray]]:
        """Go on from what ``state`` returned, by repeating the picks.

        Yields:
            What ``pick`` returns to be remembered, for each repeated step.

        Raises:
            ValueError: the picks are more than the run's, or lead to other observations.
        """
        self.steps = int(arrays["start"])
        self._starts = deque([(self.steps, arrays["generators"])])
        self._see(*self.envs.restart(arrays["generators"]))
        for actions in arrays["actions"].astype(np.int64):
            yield self.pick(actions)[1]
        if self.digest() != arrays["digest"]:
            raise ValueError(
                "its picks lead to other observations here; expected the same stack and version "
                "of unload as when it was written"
            )

    def close(self) -> None:
        """Free the environments."""
        self.envs.close()


def _next_states(
    observations: np.ndarray, terminations: np.ndarray, infos: dict[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Next observations, masks and terminations; at an episode's end the last, not the reset's."""
    observations, masks = observations.copy(), infos["action_mask"].astype(bool)
    for env in np.flatnonzero(infos.get("_final_obs", [])):
        observations[env] = infos["final_obs"][env]
        masks[env] = infos["final_info"]["action_mask"][env]
    return {"next_observations": observations, "next_masks": masks, "terminations": terminations}
