from functools import partial

import numpy as np
import pytest

from studies.seamless.jamming import jam, uniform, weigh
from unload import TrainConfig
from unload.agent.training import Training

CONFIG = TrainConfig(picks=256, num_envs=8, batch_size=64, max_picks=32, mask=True)


def test_numbers_are_spread_evenly_and_follow_their_counters():
    drawn = uniform(3, np.arange(1000), np.arange(20)[:, None])
    assert drawn.shape == (20, 1000) and (0 <= drawn).all() and (drawn < 1).all()
    assert np.histogram(drawn, 10, (0, 1))[0] == pytest.approx(2000, abs=200)
    assert len(np.unique(drawn)) == drawn.size
    assert uniform(3, 7, 5) == drawn[5, 7] != uniform(4, 7, 5)


@pytest.mark.parametrize("lasts", [0, 1, 20])
def test_a_share_of_the_free_boxes_jams(lasts):
    rates = {}
    for share in (0.0, 0.5, 1.0):
        run = Training(CONFIG, None, partial(jam, share=share, lasts=lasts))
        for _ in range(32):
            run.step()
        rates[share] = run.curve.table()["success_rate"].iloc[-1]
    assert rates[0.0] > rates[0.5] > rates[1.0] == 0


def test_another_weight_changes_which_items_are_near():
    def seen(change):
        return Training(CONFIG, None, change).rollout.observations

    assert (seen(partial(weigh, z=4.0)) == seen(partial(jam, share=0.0))).all()
    assert (seen(partial(weigh, z=1.0)) != seen(partial(weigh, z=4.0))).any()
