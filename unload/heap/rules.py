"""Picking rules that need no learning, and a family of them.

A rule scores each visible box, and the allowed box of the highest score is picked. Policies are
functions ``policy(observations, masks, rng) -> actions`` on a batch, as in ``unload.policies``:
observations (batch, 96, 13) float as ``HeapEnv`` gives them, masks (batch, 96).
"""

from collections.abc import Callable, Mapping
from itertools import product

import numpy as np

from unload.agent.policies import any_allowed
from unload.heap.camera import EYE
from unload.heap.observation import COLUMN, COLUMNS
from unload.support import checks

Score = Callable[[np.ndarray], np.ndarray]  # (batch, 96, 13) → (batch, 96)


def check_batch(observations: np.ndarray, masks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the observations as a float64 array and the masks as bool.

    Raises:
        TypeError, ValueError: they are not as described above, or a mask allows no box.
    """
    observations = checks.finite_array("observations", observations, (None, None, len(COLUMNS)))
    allowed = checks.flag_array("masks", masks, observations.shape[:2])
    if not allowed.any(axis=1).all():
        row = int(np.argmin(allowed.any(axis=1)))
        raise ValueError(f"masks is all zero in row {row}; expected at least one box to pick")
    return observations, allowed


def best(score: Score) -> Callable:
    """The policy that picks the allowed box with the highest score, the foremost if several."""

    def policy(observations, masks, rng):
        observations, allowed = check_batch(observations, masks)
        return np.where(allowed, score(observations), -np.inf).argmax(axis=1)

    return policy


def linear(weights: Mapping[str, float]) -> Score:
    """The score that is a weighted sum of columns of the observation.

    Raises:
        ValueError: a name is no column.
    """
    for name in weights:
        checks.one_of("a column", name, COLUMNS)
    vector = np.array([weights.get(name, 0.0) for name in COLUMNS])
    return lambda observations: observations @ vector


def random(observations: np.ndarray, masks: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Any allowed box, each with the same probability."""
    _, allowed = check_batch(observations, masks)
    return any_allowed(allowed, checks.generator("rng", rng))


def _nearness(observations: np.ndarray) -> np.ndarray:
    """Minus the squared distance from the camera, as if the foremost face stood at the door."""
    place = observations[..., [COLUMN["behind"], COLUMN["y"], COLUMN["z"]]]
    return -((place - (-2.0, 0.0, EYE[2])) ** 2).sum(axis=-1)


def _clear_above(observations: np.ndarray) -> np.ndarray:
    """The foremost box among those of which at most a tenth is covered."""
    clear = observations[..., COLUMN["clear_above"]] >= 0.9
    return 10 * clear - observations[..., COLUMN["behind"]]


RULES = {
    "random": random,
    "highest": best(linear({"z": 1})),
    "nearest": best(_nearness),
    "lowest": best(linear({"z": -1})),
    "foremost": best(linear({"behind": -1})),
    "clear above": best(_clear_above),
}
# A box near the front takes many along if others lie before it and on it; how much each of these
# counts is what the family varies.
FAMILY_COLUMNS = {
    "behind": (-1.0, -0.5, 0.0, 0.5),
    "z": (-1.0, -0.5, 0.0, 0.5),
    "clear_in_front": (-1.0, -0.5, 0.0),
    "clear_above": (-0.5, 0.0, 0.5),
}


def family() -> dict[str, dict[str, float]]:
    """All linear rules of the family by name: the weight of each column.

    Of rules that pick the same, because they are multiples of one another, one is there.
    """
    rules, directions = {}, set()
    for values in product(*FAMILY_COLUMNS.values()):
        largest = max(map(abs, values))
        direction = tuple(value / largest for value in values) if largest else None
        if direction and direction not in directions:
            directions.add(direction)
            weights = {name: value for name, value in zip(FAMILY_COLUMNS, values) if value}
            rules[" ".join(f"{value:+g} {name}" for name, value in weights.items())] = weights
    return rules
