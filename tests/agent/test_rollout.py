import numpy as np
import pytest

from tests.agent.runs import CONTAINER, RUNS, few_walls
from unload import TrainConfig, train
from unload.agent.training import Training
from unload.env.vector import ContainerVectorEnv


@pytest.mark.parametrize("mask", [False, True])
def test_the_bootstrap_maximum_obeys_the_mask(mask):
    """A failed item is out of the next state's maximum, whether training masks choices or not."""
    config = TrainConfig(**CONTAINER | {"gamma": 0.9, "mask": mask, "epsilon_final": 1.0})
    run = Training(config)
    for _ in range(20):
        run.step()
    stored = run.replay.arrays
    failed = np.flatnonzero(stored["rewards"][: len(run.replay)] < 0)
    assert len(failed) > 10
    assert not stored["next_masks"][failed, stored["actions"][failed]].any()
    assert (run.rollout.allowed & (run.rollout.masks == 0)).any() == (not mask)


def test_training_without_the_mask_picks_items_only(tmp_path, monkeypatch):
    fewest, pick = [], ContainerVectorEnv._pick

    def watched(envs, actions, playing):
        fewest.append((envs.visible >= 0).sum(axis=1).min())
        assert (envs.visible[np.arange(len(actions)), actions] >= 0).all()
        return pick(envs, actions, playing)

    monkeypatch.setattr(ContainerVectorEnv, "_pick", watched)
    config = TrainConfig(picks=800, num_envs=4, batch_size=32, n_features=4, mask=False)
    train(config, tmp_path, progress=False, stack=few_walls)
    assert min(fewest) < 70  # of 128 rows


def test_a_pick_says_how_far_it_has_lifted(monkeypatch):
    """Also where it was an episode's last one, whose infos stand apart; NaN without lifts."""
    lifted, pick = [], ContainerVectorEnv._pick

    def watched(envs, actions, playing):
        rewards = pick(envs, actions, playing)
        lifted.append(envs._distances.copy())
        return rewards

    monkeypatch.setattr(ContainerVectorEnv, "_pick", watched)
    run = Training(TrainConfig(**CONTAINER | {"max_picks": 3}))
    for _ in range(7):
        picks, distances = run.rollout.pick(np.array([0, 20, 40, 60]))
        assert (distances == lifted[-1]).all()
        assert ((distances >= 0.2) == (picks["rewards"] > 0)).all()
    assert np.unique(lifted).size > 1
    run = Training(TrainConfig(**RUNS["highest item"]))
    assert np.isnan(run.rollout.pick(np.zeros(4, int))[1]).all()
