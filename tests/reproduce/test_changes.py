"""Changes of a training run."""

import numpy as np

from unload import TrainConfig
from unload.agent.training import Training
from unload.reproduce.changes import height_reward


def test_height_reward_shapes_what_is_learned_and_not_what_is_seen():
    config = TrainConfig(picks=64 * 20, batch_size=64, equalize=False)
    plain, shaped = Training(config), Training(config)
    height_reward(0.4)(shaped)
    heights = plain.rollout.observations[..., 2].copy()
    plain.step()
    shaped.step()
    rewards, learned = (run.replay.arrays["rewards"][:64] for run in (plain, shaped))
    heights = heights[np.arange(64), plain.replay.arrays["actions"][:64]]
    expected = rewards + 0.4 * (heights + 1) / 2 * (rewards < 0)
    np.testing.assert_allclose(learned, expected, rtol=1e-6)
    assert (rewards < 0).any() and (rewards > 0).any()
    assert plain.curve.sums == shaped.curve.sums
    for run in (plain, shaped):
        run.rollout.close()
