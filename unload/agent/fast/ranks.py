"""Equalized observations in bytes: a quarter of the memory, and not a bit lost.

Among 128 items, a coordinate (2 r - 127) / 127 is told by twice the item's rank r, which is an
integer from 0 to 254 even where ties share the mean of their ranks.
"""

import numpy as np

from unload import task
from unload.agent.fast.kernel import LAST, level
from unload.env.fast.ranking import LEVELS
from unload.support.compiled import compiled

COORDINATES = LEVELS[task.N_VISIBLE]  # by twice the rank


def encode(observations: np.ndarray) -> np.ndarray:
    """Twice the ranks, uint8 of the same shape as ``observations``, float32.

    Raises:
        ValueError: a number is no equalized coordinate of 128 items, as it happens where fewer
            are left.
    """
    codes = np.empty(observations.shape, np.uint8)
    numbers = np.ascontiguousarray(observations).reshape(-1)
    if not _encode(numbers, codes.reshape(-1)):
        wrong = numbers[decode(codes).reshape(-1) != numbers][0]
        raise ValueError(
            f"observations holds {wrong}; expected equalized coordinates of {task.N_VISIBLE} items"
        )
    return codes


def decode(codes: np.ndarray) -> np.ndarray:
    """The observations that ``encode`` was given."""
    return COORDINATES[codes]


@compiled
def _encode(numbers, codes):
    """Fill ``codes``; whether all can be decoded."""
    exact = True
    for i in range(len(numbers)):
        twice = np.rint(numbers[i] * LAST + LAST)
        code = np.uint8(np.int32(min(max(twice, np.float32(0)), 2 * LAST)))
        codes[i] = code
        exact &= level(np.float32(code)) == numbers[i]
    return exact
