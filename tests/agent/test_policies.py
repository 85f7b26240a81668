import numpy as np
import pytest

from unload import policies

POLICIES = [policies.random, policies.nearest, policies.highest]


def test_random_is_uniform_over_the_allowed(rng):
    masks = np.tile([1, 0, 1, 1], (30_000, 1))
    actions = policies.random(np.zeros((30_000, 4, 3)), masks, rng)
    shares = np.bincount(actions, minlength=4) / 30_000
    assert shares == pytest.approx([1 / 3, 0, 1 / 3, 1 / 3], abs=0.015)


def test_nearest_takes_the_first_allowed_row_and_highest_the_highest(rng):
    observations = np.zeros((3, 4, 3))
    observations[..., 2] = [-0.9, 0.1, 0.8, 0.2]
    masks = np.array([[1, 1, 1, 1], [1, 1, 0, 0], [0, 0, 0, 1]])
    assert policies.nearest(observations, masks, rng).tolist() == [0, 0, 3]
    actions = policies.highest(observations, masks, rng)
    assert actions.tolist() == [2, 1, 3] and actions.dtype == np.int64


@pytest.mark.parametrize("policy", POLICIES)
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


def test_a_mixed_policy_picks_at_random_now_and_then(rng):
    observations = rng.uniform(-1, 1, (4000, 128, 3))
    masks = np.ones((4000, 128), bool)
    best = policies.highest(observations, masks, rng)
    for share in (0.0, 0.3, 1.0):
        actions = policies.mixed(policies.highest, share)(observations, masks, rng)
        assert abs((actions != best).mean() - share * 127 / 128) < 0.03
    with pytest.raises(ValueError, match="share is 2"):
        policies.mixed(policies.highest, 2)
    with pytest.raises(TypeError, match="rng is None"):
        policies.random(observations, masks, None)
