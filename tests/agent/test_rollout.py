import numpy as np
import pytest

from tests.agent.runs import CONTAINER, assert_same, at_step, begun, interrupt
from unload import TrainConfig, stack_load, train
from unload.env.vector import ContainerVectorEnv


@pytest.mark.parametrize("mask", [False, True])
def test_the_bootstrap_maximum_obeys_the_mask(tmp_path, mask):
    """A failed item is out of the next state's maximum, whether training masks choices or not."""
    config = TrainConfig(**CONTAINER | {"gamma": 0.9, "mask": mask, "epsilon_final": 1.0})
    with begun(config, tmp_path) as run:
        for _ in range(20):
            run.step()
    stored = run.replay.arrays
    failed = np.flatnonzero(stored["rewards"][: len(run.replay)] < 0)
    assert len(failed) > 10
    assert not stored["next_masks"][failed, stored["actions"][failed]].any()
    assert (run.rollout.allowed & (run.rollout.masks == 0)).any() == (not mask)


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


def test_a_checkpoint_reaches_back_as_far_as_the_memory(tmp_path):
    """Of 25 steps, where episodes of 12 steps begin together."""
    with begun(TrainConfig(**CONTAINER), tmp_path) as run:
        for _ in range(49):
            run.step()
        assert run.rollout.state()["start"] == 12


def test_training_meets_other_loads_than_evaluate_does_with_its_seed(tmp_path):
    with begun(TrainConfig(**CONTAINER), tmp_path) as run:
        met = {observation.tobytes() for observation in run.rollout.observations}
    envs = ContainerVectorEnv(8, equalize=True)
    shown, _ = envs.reset(seed=np.random.SeedSequence(0).generate_state(8).tolist())
    envs.close()
    assert not met & {observation.tobytes() for observation in shown}


@pytest.mark.parametrize("stop", [3, 30, 90])
def test_a_run_on_loads_of_few_items_goes_on_from_its_first_pick(tmp_path, few_items, stop):
    """Their episodes hardly ever begin together."""

    def stack(rng):
        return few_items(rng, int(rng.integers(1, 30)))

    config = TrainConfig(**CONTAINER | {"picks": 400, "max_picks": 20, "equalize": False})
    train(config, tmp_path / "straight", progress=False, stack=stack)
    with at_step(stop, interrupt), pytest.raises(KeyboardInterrupt):
        train(config, tmp_path / "broken", progress=False, stack=stack)
    train(config, tmp_path / "broken", progress=False, stack=stack)
    assert_same(tmp_path / "straight", tmp_path / "broken")
