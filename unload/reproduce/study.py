"""Why 60 %? Controlled experiments on the paper's training.

Each experiment is a set of training runs that differ from the paper's configuration in what
is under test and in the seed, and in what makes them affordable: fewer picks, and a batch of
256, for an update eight times cheaper; the search shows what the batch changes. Networks
without a fused update are small, too, and compared with the paper's at their size.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import product

from unload.agent.config import TrainConfig

# What the network sees of an item's position.
FEATURES = {
    "positions": {"equalize": False},  # scaled
    "noisy ranks": {"equalize": True, "ties": "noise"},  # equalized, as in the paper
    "tied ranks": {"equalize": True, "ties": "average"},
}
FLOORS = (0.0, 0.05)  # of the exploration rate
BASE = TrainConfig(batch_size=256, snapshots=20)


def factorial(picks: int = 2_000_000, seeds: int = 5) -> dict[str, TrainConfig]:
    """Features × mask in training × exploration floor."""
    return {
        f"{features}/{'mask' if mask else 'no mask'}/floor {floor:g}/seed_{seed}": replace(
            BASE, picks=picks, seed=seed, mask=mask, epsilon_final=floor, **FEATURES[features]
        )
        for features, mask, floor, seed in product(FEATURES, (False, True), FLOORS, range(seeds))
    }


def search(picks: int = 1_000_000, seeds: int = 3) -> dict[str, TrainConfig]:
    """One setting at a time, with the paper's features."""
    changes = [
        {},
        {"n_features": 16},
        {"n_features": 256},
        {"learning_rate": 1e-4},
        {"learning_rate": 1e-2},
        {"batch_size": 64},
        {"batch_size": 2048},
        {"gradient_steps": 4},
    ]
    return _varied(changes, ("noisy ranks",), picks, seeds)


def rewards(picks: int = 1_000_000, seeds: int = 3) -> dict[str, TrainConfig]:
    """The paper's outlook: failing at a higher item is less bad."""
    changes = [{"height_reward": share} for share in (0.0, 0.25, 0.5, 0.9)]
    return _varied(changes, ("noisy ranks",), picks, seeds)


SMALL = {"n_features": 32, "batch_size": 64}  # affordable without a fused update


def networks(picks: int = 320_000, seeds: int = 3) -> dict[str, TrainConfig]:
    """Other networks, all of them small."""
    changes = [{"network": name} | SMALL for name in ("peq", "two_layer", "stack")]
    return _varied(changes, ("noisy ranks",), picks, seeds)


def attention(picks: int = 320_000, seeds: int = 2) -> dict[str, TrainConfig]:
    """One more network, on its own: to train and to judge it takes five times as long."""
    change = {"network": "attention"} | SMALL | {"snapshots": 4}
    return _varied([change], ("noisy ranks",), picks, seeds)


def long(picks: int = 20_000_000, seeds: int = 3) -> dict[str, TrainConfig]:
    """The best cell of the factorial study for as long as the paper trained."""
    return _varied([{}], ("positions",), picks, seeds)


def endings(picks: int = 20_000_000, seeds: int = 4) -> dict[str, TrainConfig]:
    """The paper's features and picks, with more seeds than its batch would allow."""
    return _varied([{}], ("noisy ranks",), picks, seeds)


def recommended(picks: int = 1_000_000, seeds: int = 5) -> dict[str, TrainConfig]:
    """The paper's configuration but for one thing, and shorter: positions, not ranks."""
    return _varied([{"batch_size": TrainConfig().batch_size}], ("positions",), picks, seeds)


EXPERIMENTS: dict[str, Callable[..., dict[str, TrainConfig]]] = {
    experiment.__name__: experiment
    for experiment in (factorial, recommended, rewards, search, networks, attention, long, endings)
}


def _varied(
    changes: list[dict], features: tuple[str, ...], picks: int, seeds: int
) -> dict[str, TrainConfig]:
    """A run for each change, features and seed."""
    return {
        f"{name}/{_name(change)}/seed_{seed}": replace(
            BASE, picks=picks, seed=seed, **FEATURES[name], **change
        )
        for name, change, seed in product(features, changes, range(seeds))
    }


def _name(change: dict) -> str:
    return ", ".join(f"{field} {value}" for field, value in change.items()) or "base"


def features_of(config: TrainConfig) -> str:
    """The name in ``FEATURES`` of what a configuration lets the network see."""
    if not config.equalize:
        return "positions"
    return {"noise": "noisy ranks", "average": "tied ranks"}[config.ties]
