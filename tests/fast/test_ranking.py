"""Algorithm 1 compiled, against ``unload.equalize``."""

import numpy as np

from unload import equalize
from unload.fast.ranking import TIE_TOLERANCE, features


def test_values_as_far_apart_as_the_tolerance_are_a_tie():
    """Two values on each axis: a little closer, exactly as far apart, and a little farther."""
    tolerance = np.float32(TIE_TOLERANCE)
    bounds = [np.nextafter(tolerance, np.float32(towards)) for towards in (0, 1)]
    values = np.array([[0, step] for step in (bounds[0], tolerance, bounds[1])], np.float32)
    ranks, observation = np.tile(np.arange(2, dtype=np.int32), (3, 1)), np.empty((2, 3), np.float32)
    features(values, ranks, True, True, observation, 2)
    assert observation.tolist() == [[0, 0, -1], [0, 0, 1]]
    assert observation.tobytes() == equalize(values.T, "average").tobytes()
