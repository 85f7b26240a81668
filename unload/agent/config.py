"""The configuration of a training run (Sec. IV-B)."""

from dataclasses import dataclass

import numpy as np

from unload.env.equalization import TIES
from unload.env.observation import MOST_NOISE, POSITION_NOISE
from unload.network.variants import HEADS, NETWORKS
from unload.support import checks

ENVS = ("unload/Container-v0", "unload/HighestItem-v0")


@dataclass(frozen=True)
class TrainConfig:
    """One training run. The defaults are the paper's (Sec. IV-B); * marks our own choice."""

    env: str = "unload/Container-v0"
    picks: int = 20_000_000  # K, over all environments
    seed: int = 0  # * of loads, exploration, replay and weights
    num_envs: int = 64  # Fig. 2
    max_picks: int = 500  # of an episode, Sec. III-C
    learning_rate: float = 1e-3  # μ
    batch_size: int = 2048  # b
    replay_size: int = 2**20
    epsilon_init: float = 1.0
    epsilon_final: float = 0.0
    epsilon_fraction: float = 0.5  # K_ε / K
    gamma: float = 0.0  # Sec. III-E
    beta: float = 1.0  # Sec. III-G
    # Sec. III-G; the others, in unload.network.variants, take padded rows for items in training.
    network: str = "peq"
    n_features: int = 64  # * n
    equalize: bool = True  # Sec. III-F
    ties: str = "noise"  # * see unload.equalize
    # * m, see ContainerEnv; 0 leaves equal coordinates equal, and ranks them in the items' order.
    position_noise: float = POSITION_NOISE
    mask: bool = False  # * whether failed items are masked in training's choices, too
    # * x and y of each stored pick are permuted among its items, so that no place can be learned,
    # and no preference for one can grow (notebook 10). Choices see the places as they are.
    shuffle_places: bool = False
    gradient_steps: int = 1  # * updates per step of all environments
    target_update_interval: int = 10_000  # * picks, as in Stable-Baselines3
    log_interval: int = 500  # * steps of all environments per point of the curves
    checkpoint_interval: float = 60.0  # * seconds

    def __post_init__(self) -> None:
        checks.one_of("env", self.env, ENVS)
        checks.one_of("ties", self.ties, TIES)
        checks.one_of("network", self.network, NETWORKS)
        for name in ("env", "ties", "network"):
            self._set(name, str(getattr(self, name)))
        for name in ("equalize", "mask", "shuffle_places"):
            self._set(name, checks.boolean(name, getattr(self, name)))
        for name in (
            "picks", "num_envs", "max_picks", "batch_size", "replay_size", "n_features",
            "target_update_interval", "log_interval",
        ):  # fmt: skip
            self._set(name, checks.integer(name, getattr(self, name), 1))
        for name in ("seed", "gradient_steps"):
            self._set(name, checks.integer(name, getattr(self, name), 0))
        for name in ("epsilon_init", "epsilon_final", "epsilon_fraction", "gamma"):
            self._set(name, checks.real(name, getattr(self, name), 0, 1))
        for name in ("learning_rate", "beta", "checkpoint_interval"):
            self._set(name, checks.real(name, getattr(self, name), 0))
        self._set(
            "position_noise", checks.real("position_noise", self.position_noise, 0, MOST_NOISE)
        )
        if self.network == "attention" and self.n_features % HEADS:
            raise ValueError(
                f"n_features is {self.n_features}; expected a multiple of {HEADS} for "
                "network='attention'"
            )
        if self.shuffle_places and self.gamma > 0:
            raise ValueError(
                f"gamma is {self.gamma}; expected 0 with shuffle_places=True, because values of "
                "next observations rest on their places"
            )
        if self.picks % self.num_envs:
            raise ValueError(
                f"picks is {self.picks}; expected a multiple of num_envs={self.num_envs}"
            )
        if self.replay_size < self.num_envs:
            raise ValueError(
                f"replay_size is {self.replay_size}; expected at least num_envs={self.num_envs}"
            )

    def _set(self, name: str, value: object) -> None:
        """Keep a checked value as one of Python's own types, which JSON can hold."""
        object.__setattr__(self, name, value)

    def epsilon(self, picks: int) -> float:
        """Exploration rate after ``picks`` picks: linear from init to final, then constant."""
        span = self.epsilon_fraction * self.picks
        progress = min(1.0, picks / span) if span else 1.0
        return self.epsilon_init + progress * (self.epsilon_final - self.epsilon_init)

    def seeds(self) -> tuple[int, int, int]:
        """Return the seeds of the environments, of exploration and batches, and of the weights.

        The key keeps the loads apart from those that ``unload.evaluate`` draws with the same
        seed.
        """
        return tuple(np.random.SeedSequence(self.seed, spawn_key=(1,)).generate_state(3).tolist())
