"""Algorithm 1 compiled, against ``unload.equalize``."""

import numpy as np
import pytest

from unload import equalize
from unload.fast.ranking import features


@pytest.mark.parametrize("tolerance", [0.25, 0.2499, 0.0])
def test_values_as_far_apart_as_the_tolerance_are_a_tie(tolerance):
    values = np.tile(np.arange(128, dtype=np.float32) // 2 / 4, (3, 1))  # 0, 0, 0.25, 0.25, 0.5, …
    observation = np.empty((128, 3), np.float32)
    ranks = np.tile(np.arange(128, dtype=np.int32), (3, 1))
    features(values, ranks, True, True, np.float32(tolerance), observation)
    assert observation.tobytes() == equalize(values.T, "average", tolerance).tobytes()
    assert (observation == 0).all() == (tolerance == 0.25)
