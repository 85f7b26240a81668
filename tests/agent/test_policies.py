import numpy as np
import pytest

from unload import policies


def test_random_is_uniform_over_the_allowed(rng):
    masks = np.tile([1, 0, 1, 1], (30_000, 1))
    actions = policies.random(np.zeros((30_000, 4, 3)), masks, rng)
    shares = np.bincount(actions, minlength=4) / 30_000
    assert shares == pytest.approx([1 / 3, 0, 1 / 3, 1 / 3], abs=0.015)


def test_nearest_takes_the_first_allowed_row_and_highest_the_highest(rng):
    observations = np.zeros((4, 4, 3))
    observations[..., 2] = [-0.9, 0.1, 0.8, 0.2]
    masks = np.array([[1, 1, 1, 1], [1, 1, 0, 0], [0, 0, 0, 1], [1, 0, 0, 0]])
    assert policies.nearest(observations, masks, rng).tolist() == [0, 0, 3, 0]
    actions = policies.highest(observations, masks, rng)
    assert actions.tolist() == [2, 1, 3, 0] and actions.dtype == np.int64


@pytest.mark.parametrize("policy", [policies.random, policies.nearest, policies.highest])
@pytest.mark.parametrize(
    ("observations", "masks", "error", "message"),
    [
        (np.zeros((2, 2, 3)), [[0, 1], [0, 0]], ValueError, "masks is all zero in row 1"),
        (np.zeros((2, 4, 3)), np.ones((2, 5)), ValueError, r"shape \(2, 5\); expected \(2, 4\)"),
        (np.zeros((2, 4, 2)), np.ones((2, 4)), ValueError, r"observations has shape \(2, 4, 2\)"),
        (np.full((1, 1, 3), np.nan), [[1]], ValueError, "observations holds nan"),
        (np.zeros((1, 2, 3)), [[1, -1]], ValueError, "masks holds -1"),
    ],
)
def test_bad_batches_are_refused(policy, observations, masks, error, message, rng):
    with pytest.raises(error, match=message):
        policy(observations, masks, rng)
