"""Ranks that are kept while items come and go."""

import numpy as np

from unload.env.equalization import equalize
from unload.fast.ranking import features, rank, remove, replace
from unload.task import TIE_TOLERANCE


def test_ranks_are_those_of_a_stable_sort_whatever_comes_and_goes(rng):
    """Of few different values, so that many are equal."""
    values, ranks = rng.integers(5, size=20).astype(np.float32), np.zeros(20, np.int32)
    rank(values, ranks)
    for left in (*[20] * 30, *range(19, 0, -1)):
        row = rng.integers(min(left + 1, 20))
        if left == 20:
            replace(values, ranks, row, np.float32(rng.integers(5)))
        else:
            remove(values[: left + 1], ranks[: left + 1], row)
        sorted_items = values[:left].argsort(kind="stable")
        assert ranks[sorted_items].tolist() == list(range(left))


def test_values_as_far_apart_as_the_tolerance_are_a_tie():
    """Compiled or not: a little closer on each axis, exactly as far apart, and a little farther."""
    tolerance = np.float32(TIE_TOLERANCE)
    bounds = [np.nextafter(tolerance, np.float32(towards)) for towards in (0, 1)]
    values = np.array([[0, step] for step in (bounds[0], tolerance, bounds[1])], np.float32)
    ranks, observation = np.tile(np.arange(2, dtype=np.int32), (3, 1)), np.empty((2, 3), np.float32)
    features(values, ranks, True, True, observation, 2)
    assert observation.tolist() == [[0, 0, -1], [0, 0, 1]]
    assert observation.tobytes() == equalize(values.T, "average").tobytes()
