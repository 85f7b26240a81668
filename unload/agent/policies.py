"""Picking policies that need no learning.

A policy is a function ``policy(observations, masks, rng) -> actions`` on a batch:
observations (batch, 128, 3) float as ``unload/Container-v0`` gives them, nearest item
first and not equalized; masks (batch, 128), bool or 0 and 1, where a row may be picked, 0 at
least in rows that hold no item; ``rng`` a ``numpy.random.Generator``; actions (batch,) int64.
``unload.Greedy`` is a learned one.
"""

from collections.abc import Callable

import numpy as np

from unload.support import checks

Policy = Callable[[np.ndarray, np.ndarray, np.random.Generator], np.ndarray]


def check_batch(observations: np.ndarray, masks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the observations as a float64 array and the masks as bool."""
    observations = checks.finite_array("observations", observations, (None, None, 3))
    allowed = checks.flag_array("masks", masks, observations.shape[:2])
    if not allowed.any(axis=1).all():
        row = int(np.argmin(allowed.any(axis=1)))
        raise ValueError(f"masks is all zero in row {row}; expected at least one item to pick")
    return observations, allowed


def random(observations: np.ndarray, masks: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Any allowed item, each with the same probability."""
    _, allowed = check_batch(observations, masks)
    return any_allowed(allowed, checks.generator("rng", rng))


def any_allowed(allowed: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """An allowed action, each with the same probability, (batch,) int64."""
    draws = np.where(allowed, rng.random(allowed.shape), -1.0)
    return draws.argmax(axis=1)


def choosable(masks: np.ndarray, present: np.ndarray) -> np.ndarray:
    """The masks, and where one excludes all, the items that are present.

    Both are (batch, 128), bool or 0 and 1, and so is what is returned. A load of upright boxes in
    walls, as the paper's, always has a box that can be lifted; with others a container may get
    stuck, and its episode still has picks to make.
    """
    return masks | present & ~masks.any(axis=1, keepdims=True)


def nearest(observations: np.ndarray, masks: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The allowed item nearest to the entrance, by the distance of Sec. III-B."""
    _, allowed = check_batch(observations, masks)
    return allowed.argmax(axis=1)


def highest(observations: np.ndarray, masks: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The allowed item whose centre is highest; in the paper's loads nothing lies on it."""
    observations, allowed = check_batch(observations, masks)
    return np.where(allowed, observations[..., 2], -np.inf).argmax(axis=1)
