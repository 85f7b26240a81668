"""The configuration of a training run (Sec. IV-B)."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import gymnasium
import numpy as np

from unload import task
from unload.checkpoint.settings import plain
from unload.env.equalization import TIES
from unload.env.observation import MOST_NOISE, POSITION_NOISE
from unload.network.factory import NETWORKS
from unload.support import checks

ENVS = (task.CONTAINER_ENV, task.HIGHEST_ITEM_ENV)
# K_ε / K, the share of the picks over which exploration falls (Sec. IV-B).
EXPLORATION_FRACTION = 0.5


def _registered(name: str, env: object) -> str:
    spec = gymnasium.registry.get(env) if isinstance(env, str) else None
    if spec is None or spec.vector_entry_point is None:
        known = ", ".join(map(repr, ENVS))
        wanted = f"expected {known}, or an id that is registered with a vector_entry_point"
        raise ValueError(f"{name} is {env!r}; {wanted}")
    return spec.id


def _network(name: str, network: object) -> str | Callable:
    return network if callable(network) else checks.one_of(name, network, NETWORKS)


_COUNT, _COUNT_OR_ZERO = partial(checks.integer, low=1), partial(checks.integer, low=0)
_SHARE = partial(checks.real, low=0, high=1.0)
# What checks the value of each field, and returns it as one of Python's own types.
_CHECKS: dict[str, Callable] = {
    "env": _registered,
    "picks": _COUNT,
    "seed": _COUNT_OR_ZERO,
    "num_envs": _COUNT,
    "max_picks": _COUNT,
    "learning_rate": partial(checks.real, low=0, high=1e37),  # Adam's steps must fit into float32
    "batch_size": _COUNT,
    "replay_size": _COUNT,
    "epsilon_init": _SHARE,
    "epsilon_final": _SHARE,
    "gamma": _SHARE,
    "beta": partial(checks.real, low=0),
    "network": _network,
    "n_features": _COUNT,
    "equalize": checks.boolean,
    "ties": partial(checks.one_of, options=TIES),
    "position_noise": partial(checks.real, low=0, high=MOST_NOISE),
    "mask": checks.boolean,
    "gradient_steps": _COUNT_OR_ZERO,
    "target_update_interval": _COUNT,
    "log_interval": _COUNT_OR_ZERO,
}


@dataclass(frozen=True)
class TrainConfig:
    """One training run. The defaults are the paper's (Sec. IV-B); * marks our own choice.

    Attributes:
        env: the task, ``"unload/Container-v0"``, ``"unload/HighestItem-v0"``, or an id of your own
            with the same spaces, registered with a ``vector_entry_point``: a subclass of
            ``ContainerVectorEnv``, with other rewards, say. A run knows it by its id alone.
        picks: K, over all environments; a multiple of ``num_envs``.
        seed: * of loads, exploration, replay and weights.
        num_envs: environments side by side (Fig. 2).
        max_picks: of an episode (Sec. III-C).
        learning_rate: μ, of Adam, at most 1e37.
        batch_size: b, picks per update.
        replay_size: picks that the replay memory holds.
        epsilon_init, epsilon_final: exploration rate at the start, and from half of the picks on.
        gamma: discount (Sec. III-E).
        beta: threshold of the smooth-L1 loss (Sec. III-G).
        network: ``"peq"`` (Sec. III-G), or a function ``(n_features, generator)`` that makes a
            network of your own, see ``unload.network.factory.make_network``. In training it is
            called without ``present``, so that padded rows count as items.
        n_features: * n, features per item.
        equalize: whether observations are equalized (Sec. III-F).
        ties: * ``"noise"`` or ``"average"``, see ``unload.equalize``.
        position_noise: * m, see ``ContainerEnv``; 0 ranks equal coordinates in the items' order.
        mask: * if True, training may not choose items that have failed since the last success
            either; if False, only rows without an item are excluded. The maximum in a target, which
            needs ``gamma`` > 0, leaves failed items out in both cases, as ``unload.evaluate`` does
            by default.
        gradient_steps: * updates per step of all environments.
        target_update_interval: * picks, as in Stable-Baselines3; without effect if gamma is 0.
        log_interval: * steps of all environments per point of the curve; 0 stands for a hundredth
            of the run, at most 500. ``dataclasses.replace`` copies the number, not the 0.

    Raises:
        TypeError, ValueError: a field is not as described, or the picks are too few to learn from.
    """

    env: str = "unload/Container-v0"
    picks: int = 20_000_000
    seed: int = 0
    num_envs: int = task.NUM_ENVS
    max_picks: int = task.MAX_PICKS
    learning_rate: float = 1e-3
    batch_size: int = 2048
    replay_size: int = 2**20
    epsilon_init: float = 1.0
    epsilon_final: float = 0.0
    gamma: float = 0.0
    beta: float = 1.0
    network: str | Callable = "peq"
    n_features: int = 64
    equalize: bool = True
    ties: str = "noise"
    position_noise: float = POSITION_NOISE
    mask: bool = False
    gradient_steps: int = 1
    target_update_interval: int = 10_000
    log_interval: int = 0

    def __post_init__(self) -> None:
        for name, check in _CHECKS.items():
            object.__setattr__(self, name, check(name, getattr(self, name)))
        hundredth = max(1, self.picks // self.num_envs // 100)
        object.__setattr__(self, "log_interval", self.log_interval or min(500, hundredth))

        # What the fields must be of each other. An update needs a batch of earlier steps' picks.
        fewest = self.num_envs + min(self.batch_size, self.replay_size)
        for name, wrong, wanted in (
            ("picks", self.picks % self.num_envs, f"a multiple of num_envs={self.num_envs}"),
            ("replay_size", self.replay_size < self.num_envs, f"num_envs={self.num_envs} or more"),
            (
                "picks",
                self.gradient_steps and self.picks < fewest,
                f"at least {fewest}, because the first update waits for "
                f"batch_size={self.batch_size}",
            ),
        ):
            if wrong:
                raise ValueError(f"{name} is {getattr(self, name)}; expected {wanted}")

    def plain(self) -> dict:
        """Return the fields as JSON can hold them, a function by its qualified name."""
        return plain(vars(self))

    def epsilon(self, picks: int) -> float:
        """Exploration rate after ``picks`` picks: linear from init to final, then constant."""
        progress = min(1.0, picks / (EXPLORATION_FRACTION * self.picks))
        return self.epsilon_init + progress * (self.epsilon_final - self.epsilon_init)

    def seeds(self) -> tuple[int, int, int]:
        """Return the seeds of the environments, of exploration and batches, and of the weights.

        The spawn key gives other loads than ``unload.evaluate`` draws with the same seed.
        """
        return tuple(np.random.SeedSequence(self.seed, spawn_key=(1,)).generate_state(3).tolist())
