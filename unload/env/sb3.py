"""Many containers as Stable-Baselines3 takes them; needs ``pip install unload[sb3]``.

Five lines train a policy that sees the mask, to an MSR of 100 % within seconds:

    from sb3_contrib import MaskablePPO
    from unload.env.sb3 import ContainerVecEnv

    envs = ContainerVecEnv(num_envs=64)
    model = MaskablePPO("MlpPolicy", envs, n_steps=16, batch_size=256, gamma=0, learning_rate=1e-3)
    model.learn(30_000)
"""

import numpy as np

from unload import task
from unload.env.vector import ContainerVectorEnv

try:
    from stable_baselines3.common.vec_env import VecEnv
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(
        "unload.env.sb3 needs Stable-Baselines3: pip install 'unload[sb3]'"
    ) from error


class ContainerVecEnv(VecEnv):
    """``ContainerVectorEnv``, with its arguments, for Stable-Baselines3."""

    def __init__(self, num_envs: int = task.NUM_ENVS, **settings) -> None:
        self.envs = ContainerVectorEnv(num_envs, **settings)
        spaces = self.envs.single_observation_space, self.envs.single_action_space
        super().__init__(num_envs, *spaces)

    def reset(self) -> np.ndarray:
        """Start all episodes, with the seed and the options, one for all, that were set before."""
        options = self._options[0]
        if any(other is not options and other != options for other in self._options):
            raise ValueError(f"options is {self._options}; expected the same for all environments")
        observations, _ = self.envs.reset(seed=self._seeds[0], options=options or None)
        self._reset_seeds()
        self._reset_options()
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

    def env_method(self, method_name: str, *args, indices=None, **kwargs) -> list:
        """The rows of ``action_masks``, which sb3-contrib asks for; no other method."""
        if method_name != "action_masks":
            raise NotImplementedError(f"{method_name} is not of each environment; ask envs itself")
        return list(self.envs.action_masks()[list(self._get_indices(indices))])

    def env_is_wrapped(self, wrapper_class, indices=None) -> list[bool]:
        return [False for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value, indices=None) -> None:
        raise NotImplementedError("the environments are one; make new ones instead")
