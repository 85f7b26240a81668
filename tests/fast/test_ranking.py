"""Algorithm 1 compiled, against ``unload.equalize``."""

import numpy as np
import pytest

from unload import equalize
from unload.fast.ranking import features, remove, replace


@pytest.fixture(params=["distinct", "ties", "equal"])
def items(request, rng) -> np.ndarray:
    """(3, 128) float32, one item per column."""
    values = rng.uniform(-1, 1, (3, 128)).astype(np.float32)
    if request.param == "ties":
        values = np.round(values, 1)
    return np.zeros_like(values) if request.param == "equal" else values


def ranks_of(values: np.ndarray) -> np.ndarray:
    return np.argsort(np.argsort(values, axis=-1, kind="stable"), axis=-1)


def test_replaced_and_removed_items_leave_the_ranks_of_a_stable_sort(items, rng):
    values = items[0].copy()
    ranks = ranks_of(values).astype(np.int32)
    for _ in range(300):
        row, value = int(rng.integers(128)), np.float32(rng.choice(items[1]))
        wanted = np.append(np.delete(values, row), value)
        replace(values, ranks, row, value)
        assert (values == wanted).all() and (ranks == ranks_of(wanted)).all()
    for count in range(127, -1, -1):
        row = int(rng.integers(count + 1))
        wanted = np.delete(values[: count + 1], row)
        remove(values[: count + 1], ranks[: count + 1], row)
        assert (values[:count] == wanted).all() and (ranks[:count] == ranks_of(wanted)).all()


@pytest.mark.parametrize("tolerance", [0.25, 0.2499, 0.0])
def test_values_as_far_apart_as_the_tolerance_are_a_tie(tolerance):
    values = np.tile(np.arange(128, dtype=np.float32) // 2 / 4, (3, 1))  # 0, 0, 0.25, 0.25, 0.5, …
    observation = np.empty((128, 3), np.float32)
    ranks = ranks_of(values).astype(np.int32)
    features(values, ranks, True, True, np.float32(tolerance), observation)
    assert observation.tobytes() == equalize(values.T, "average", tolerance).tobytes()
    assert (observation == 0).all() == (tolerance == 0.25)
