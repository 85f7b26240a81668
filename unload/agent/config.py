"""The configuration of a training run (Sec. IV-B)."""

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np

from unload.agent.identity import identity
from unload.env.equalization import TIES
from unload.env.observation import MOST_NOISE, POSITION_NOISE
from unload.network.variants import HEADS, NETWORKS
from unload.support import checks

ENVS = ("unload/Container-v0", "unload/HighestItem-v0")


@dataclass(frozen=True)
class TrainConfig:
    """One training run. The defaults are the paper's (Sec. IV-B); * marks our own choice.

    Attributes:
        env: the task, ``"unload/Container-v0"`` or ``"unload/HighestItem-v0"``.
        picks: K, over all environments; a multiple of ``num_envs``.
        seed: * of loads, exploration, replay and weights.
        num_envs: environments side by side (Fig. 2).
        max_picks: of an episode (Sec. III-C).
        learning_rate: μ, of Adam.
        batch_size: b, picks per update.
        replay_size: picks that the replay memory holds.
        epsilon_init, epsilon_final: exploration rate at the start, and at the end of its fall.
        epsilon_fraction: K_ε / K, the share of the picks over which it falls.
        gamma: discount (Sec. III-E).
        beta: threshold of the smooth-L1 loss (Sec. III-G).
        network: ``"peq"`` (Sec. III-G); the others, in ``unload.network.variants``, take padded
            rows for items in training. Or a function ``(n_features, generator)`` that makes a
            network of your own, see ``unload.network.variants.make_network``.
        n_features: * n, features per item.
        equalize: whether observations are equalized (Sec. III-F).
        ties: * ``"noise"`` or ``"average"``, see ``unload.equalize``.
        position_noise: * m, see ``ContainerEnv``; 0 ranks equal coordinates in the items' order.
        mask: * whether failed items are masked in training's choices, too.
        shuffle_places: * whether x and y of each stored pick are permuted among its items, so that
            no preference for a place can be learned (notebook 10); choices see them unpermuted.
        gradient_steps: * updates per step of all environments.
        target_update_interval: * picks, as in Stable-Baselines3; without effect if gamma is 0.
        log_interval: * steps of all environments per point of the curve.
        checkpoint_interval: * seconds between two checkpoints.

    Raises:
        TypeError, ValueError: a field is not as described, or the picks are too few to learn from.
    """

    env: str = "unload/Container-v0"
    picks: int = 20_000_000
    seed: int = 0
    num_envs: int = 64
    max_picks: int = 500
    learning_rate: float = 1e-3
    batch_size: int = 2048
    replay_size: int = 2**20
    epsilon_init: float = 1.0
    epsilon_final: float = 0.0
    epsilon_fraction: float = 0.5
    gamma: float = 0.0
    beta: float = 1.0
    network: str | Callable = "peq"
    n_features: int = 64
    equalize: bool = True
    ties: str = "noise"
    position_noise: float = POSITION_NOISE
    mask: bool = False
    shuffle_places: bool = False
    gradient_steps: int = 1
    target_update_interval: int = 10_000
    log_interval: int = 500
    checkpoint_interval: float = 600.0

    def __post_init__(self) -> None:
        for name, options in (("env", ENVS), ("ties", TIES), ("network", NETWORKS)):
            if name == "network" and callable(self.network):
                continue
            checks.one_of(name, getattr(self, name), options)
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
        fewest = self.num_envs + min(self.batch_size, self.replay_size)
        if self.gradient_steps and self.picks < fewest:
            raise ValueError(
                f"picks is {self.picks}; expected at least {fewest}, because the first update "
                f"waits for batch_size={self.batch_size}"
            )

    def _set(self, name: str, value: object) -> None:
        """Keep a checked value as one of Python's own types, which JSON can hold."""
        object.__setattr__(self, name, value)

    def plain(self) -> dict:
        """Return the fields by name as JSON can hold them, of a function its identity.

        ``checkpoint_interval`` is left out, because how often a run is saved changes nothing in it.
        """
        names = [field.name for field in fields(self) if field.name != "checkpoint_interval"]
        return {name: identity(getattr(self, name)) for name in names}

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
