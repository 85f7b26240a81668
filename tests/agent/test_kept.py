from dataclasses import replace

import numpy as np
import pytest

from unload import TrainConfig
from unload.agent.kept import KeptPicks, random_picks
from unload.agent.replay import ReplayBuffer
from unload.agent.training import Training

CONFIG = TrainConfig(picks=64 * 200, num_envs=64, batch_size=64, failures_kept=0.25)


def picks(first, count, reward):
    """Picks whose observations hold their number."""
    seen = np.zeros((count, 128, 3), np.float32) + np.arange(first, first + count)[:, None, None]
    rewards = np.full(count, reward, np.float32)
    return {"observations": seen, "actions": np.zeros(count, int), "rewards": rewards}


def numbers(replay, rng):
    """The numbers of the picks that are drawn."""
    return set(replay.sample(300, rng)["observations"][:, 0, 0].tolist())


def test_kept_picks_stay_while_others_come_and_go(rng):
    kept = [picks(100, 2, -1.0), picks(102, 1, -1.0)]
    replay = KeptPicks(8, 128, 3, kept)
    assert (len(replay), replay.size) == (3, 5) and replay.filled().tolist() == [5, 6, 7]
    assert numbers(replay, rng) == {100, 101, 102}
    replay.add(**picks(0, 2, 1.0))
    assert len(replay) == 5 and numbers(replay, rng) == {0, 1, 100, 101, 102}
    assert replay.filled().tolist() == [0, 1, 5, 6, 7]
    replay.add(**picks(2, 8, 1.0))
    replay.add(**picks(10, 4, 1.0))
    assert len(replay) == 8 and numbers(replay, rng) == {*range(9, 14), 100, 101, 102}


def test_all_picks_are_drawn_alike(rng):
    replay = KeptPicks(80, 128, 30, [picks(100, 30, -1.0)])
    replay.add(**picks(0, 10, 1.0))
    counts = np.bincount(replay.sample_rows(40_000, rng), minlength=80)
    assert (counts[10:50] == 0).all()
    assert counts[[*range(10), *range(50, 80)]].min() > 800


def test_a_wrong_number_of_kept_picks_is_refused():
    with pytest.raises(ValueError, match="kept holds 2 picks; expected count=3"):
        KeptPicks(8, 128, 3, [picks(0, 2, -1.0)])
    with pytest.raises(ValueError, match="count is 8; expected an integer >= 0 and <= 7"):
        KeptPicks(8, 128, 8, [picks(0, 8, -1.0)])


@pytest.mark.parametrize("succeeded", (False, True))
def test_random_picks_are_of_one_kind_and_of_many_containers(succeeded):
    found = list(random_picks(CONFIG, 300, np.random.default_rng(0), succeeded))
    replay = ReplayBuffer(300, 128, equalized=True)
    for batch in found:
        replay.add(**batch)
    assert len(replay) == replay.total == 300
    assert set(replay.arrays["rewards"].tolist()) == {1.0 if succeeded else -1.0}
    again = list(random_picks(CONFIG, 300, np.random.default_rng(0), succeeded))
    for batch, other in zip(found, again, strict=True):
        np.testing.assert_array_equal(batch["observations"], other["observations"])


def test_picks_that_never_come_are_reported(monkeypatch):
    monkeypatch.setattr("unload.agent.kept.MOST_PICKS", 1)
    with pytest.raises(ValueError, match="of 64064 random picks too few succeed; [0-9]+ are miss"):
        list(random_picks(CONFIG, 64_000, np.random.default_rng(0), succeeded=True))


def test_all_random_picks_come_in_their_order():
    (first, *_) = random_picks(CONFIG, 100, np.random.default_rng(0), succeeded=None)
    assert len(first["rewards"]) == 64 and set(first["rewards"].tolist()) == {1.0, -1.0}


@pytest.mark.parametrize("gamma", (0.0, 0.5))
def test_a_training_keeps_its_share_of_failures(gamma):
    run = Training(replace(CONFIG, gamma=gamma))
    size, kept = CONFIG.memory()
    assert (size, kept) == (12_800, 3200) and len(run.replay) == kept
    before = {name: array[-kept:].copy() for name, array in run.replay.arrays.items()}
    while not run.rollout.finished:
        run.step()
    run.rollout.close()
    assert len(run.replay) == size and run.replay.equalized == (gamma == 0)
    for name, array in run.replay.arrays.items():
        np.testing.assert_array_equal(array[-kept:], before[name])
    assert (before["rewards"] == -1).all()


def test_which_failures_are_kept_changes_no_other_random_number():
    keeping, plain = (Training(replace(CONFIG, failures_kept=share)) for share in (0.25, 0.0))
    assert keeping.rng.bit_generator.state == plain.rng.bit_generator.state
    np.testing.assert_array_equal(keeping.rollout.observations, plain.rollout.observations)
    for run in (keeping, plain):
        run.rollout.close()
