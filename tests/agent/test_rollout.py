import numpy as np
import pytest

from tests.agent.runs import CONTAINER, begun
from unload import TrainConfig, stack_load, train
from unload.agent.curve import CURVE_COLUMNS
from unload.env.vector import ContainerVectorEnv


@pytest.mark.parametrize("mask", [False, True])
def test_the_bootstrap_maximum_obeys_the_mask(tmp_path, mask):
    """A failed item is out of the next state's maximum, whether training masks choices or not."""
    config = TrainConfig(**CONTAINER | {"gamma": 0.9, "mask": mask, "epsilon_final": 1.0})
    with begun(config, tmp_path) as run:
        for _ in range(12):
            run.step()
    stored = run.replay.arrays
    failed = np.flatnonzero(stored["rewards"][: len(run.replay)] < 0)
    assert len(failed) > 10
    assert not stored["next_masks"][failed, stored["actions"][failed]].any()


def test_training_without_the_mask_picks_items_only(tmp_path, monkeypatch):
    fewest, pick = [], ContainerVectorEnv._pick

    def watched(envs, actions):
        fewest.append((envs.visible >= 0).sum(axis=1).min())
        assert (envs.visible[np.arange(len(actions)), actions] >= 0).all()
        return pick(envs, actions)

    monkeypatch.setattr(ContainerVectorEnv, "_pick", watched)
    config = TrainConfig(picks=800, num_envs=4, batch_size=32, n_features=4, mask=False)
    train(config, tmp_path, progress=False, stack=lambda rng: stack_load(rng, walls=1))
    assert min(fewest) < 70  # of 128 rows


def test_training_meets_other_loads_than_evaluate_does_with_its_seed(tmp_path):
    with begun(TrainConfig(**CONTAINER), tmp_path) as run:
        met = {observation.tobytes() for observation in run.rollout.observations}
    envs = ContainerVectorEnv(8, equalize=True)
    shown, _ = envs.reset(seed=np.random.SeedSequence(0).generate_state(8).tolist())
    envs.close()
    assert not met & {observation.tobytes() for observation in shown}


@pytest.mark.parametrize("equalize", [True, False])
def test_a_failed_pick_is_the_less_bad_the_higher_its_item(tmp_path, equalize):
    """The same picks with and without the reward for height, learned from or not."""
    plain = CONTAINER | {"equalize": equalize, "epsilon_final": 1.0, "log_interval": 25}
    memories, curves = [], []
    for height_reward in (0, 0.5):
        config = TrainConfig(**plain | {"height_reward": height_reward})
        with begun(config, tmp_path / str(height_reward)) as run:
            for _ in range(25):
                run.step()
        memories.append(run.replay.rows(np.arange(100)))
        curves.append(dict(zip(CURVE_COLUMNS, run.curve.points[-1], strict=True)))
    true, shaped = memories
    assert (true["actions"] == shaped["actions"]).all()
    heights = shaped["observations"][np.arange(100), shaped["actions"], 2]
    failed = true["rewards"] == -1
    assert 20 < failed.sum() < 100 and np.ptp(heights[failed]) > 0.5
    assert shaped["rewards"][failed] == pytest.approx(-1 + 0.5 * (heights[failed] + 1) / 2)
    assert (shaped["rewards"][~failed] == 1).all() and (true["rewards"][~failed] == 1).all()
    for name in ("mean_reward", "success_rate", "deadlocked"):
        assert curves[0][name] == curves[1][name]
    assert curves[0]["mean_reward"] == pytest.approx(true["rewards"].mean())
    assert curves[0]["loss"] != curves[1]["loss"]
