"""What Stable-Baselines3's DQN needs to train on our environments with our network.

It takes environments of its own kind only, not Gymnasium's ``VectorEnv``.
"""

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.dqn.policies import DQNPolicy, QNetwork

from unload.network.peq import PEQNetwork


class VectorEnvAdapter(VecEnv):
    """A Gymnasium ``VectorEnv`` that resets in the same step, as Stable-Baselines3's ``VecEnv``.

    Args:
        envs: the environments.

    Raises:
        ValueError: they reset in another way.
    """

    def __init__(self, envs: gymnasium.vector.VectorEnv) -> None:
        mode = envs.metadata.get("autoreset_mode")
        if mode != AutoresetMode.SAME_STEP:
            raise ValueError(f"envs resets with {mode}; expected {AutoresetMode.SAME_STEP}")
        self.envs = envs
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)

    def reset(self) -> np.ndarray:
        """Start all episodes, with the seed of ``seed`` if one was given."""
        observations, _ = self.envs.reset(seed=self._seeds[0])
        self._reset_seeds()
        return observations

    def step_async(self, actions: np.ndarray) -> None:
        self._actions = actions

    def step_wait(self):
        """(observations, rewards, dones, one dict per environment)."""
        observations, rewards, terminations, truncations, infos = self.envs.step(self._actions)
        dones = terminations | truncations
        each: list[dict] = [{} for _ in range(self.num_envs)]
        for env in np.flatnonzero(dones):
            each[env] = {
                "terminal_observation": infos["final_obs"][env],
                "TimeLimit.truncated": bool(truncations[env] and not terminations[env]),
            }
        return observations, rewards.astype(np.float32), dones, each

    def close(self) -> None:
        self.envs.close()

    def get_attr(self, attr_name: str, indices=None) -> list:
        """What all environments have in common."""
        return [getattr(self.envs, attr_name) for _ in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class, indices=None) -> list[bool]:
        return [False for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value, indices=None) -> None:
        raise NotImplementedError("the environments are one; make new ones instead")

    def env_method(self, method_name: str, *args, indices=None, **kwargs) -> list:
        raise NotImplementedError("the environments are one; ask envs itself")


class PEQValues(QNetwork):
    """``PEQNetwork`` where Stable-Baselines3 expects a network; n is ``net_arch[0]``."""

    def __init__(self, *args, **kwargs) -> None:
        super().__init__(*args, **kwargs)
        self.q_net = PEQNetwork(self.net_arch[0])

    def forward(self, obs):
        return self.q_net(obs)


class PEQPolicy(DQNPolicy):
    """Stable-Baselines3's DQN policy with the paper's network; ``net_arch=[n]``."""

    def make_q_net(self) -> PEQValues:
        arguments = self._update_features_extractor(self.net_args, features_extractor=None)
        return PEQValues(**arguments).to(self.device)
