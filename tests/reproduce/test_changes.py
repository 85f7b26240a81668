from collections.abc import Iterator

import numpy as np
import pytest

from unload import TrainConfig
from unload.agent.replay import ReplayBuffer
from unload.agent.training import Training
from unload.reproduce import changes
from unload.reproduce.changes import CHANGES
from unload.reproduce.interventions import failure_share

KEPT_FEW = 1 / changes.FEW
STEPS = 300  # before the change; the last of an episode and a half
CONFIG = TrainConfig(
    picks=64 * 1000,
    batch_size=64,
    replay_size=2**13,
    mask=True,
    max_picks=200,
    epsilon_fraction=0.1,
)


@pytest.fixture(scope="module")
def runs() -> Iterator[dict[str, Training]]:
    """A run after each of the changes."""
    started = {}
    for name, change in CHANGES.items():
        started[name] = run = Training(CONFIG)
        for _ in range(STEPS):
            run.step()
        change(run)
    yield started
    for run in started.values():
        run.rollout.close()


def test_memories_hold_what_their_names_say(runs):
    plain = runs["nothing"].replay
    size, share = CONFIG.replay_size, failure_share(plain)
    assert plain.size == size and runs["memory_23"].replay.size == 2**23
    assert failure_share(runs["memory_23"].replay) == share < 0.6
    for name in ("failures_refilled", "failures_kept"):
        assert len(runs[name].replay) == size
        assert failure_share(runs[name].replay) == pytest.approx((1 + share) / 2, abs=0.1)
    few = KEPT_FEW + (1 - KEPT_FEW) * share
    assert failure_share(runs["few_failures_kept"].replay) == pytest.approx(few, abs=0.05)
    for name in ("all_called_failures", "successes_called_failures"):
        assert failure_share(runs[name].replay) == pytest.approx((1 + share) / 2, abs=0.1)
    successes = runs["successes_kept"].replay
    assert failure_share(successes) == pytest.approx(share / 2, abs=0.1)
    called = runs["successes_called_failures"].replay.arrays
    for name in ("observations", "actions"):
        assert np.array_equal(called[name], successes.arrays[name])


def test_settings_are_what_their_names_say(runs):
    picks = STEPS * 64
    assert runs["nothing"].config.epsilon(picks) == 0
    assert runs["exploration_held"].config.epsilon(picks) == pytest.approx(0.05)
    rates = {name: run.agent.learner.optimizer.learning_rate for name, run in runs.items()}
    assert rates.pop("learning_rate_lowered") == pytest.approx(1e-4)
    assert set(rates.values()) == {1e-3}


def test_what_is_seen_changes_only_where_it_is_said(runs):
    for name, run in runs.items():
        tied = [len(np.unique(seen[:, 2])) < 128 for seen in run.rollout.observations]
        assert any(tied) == all(tied) == (name == "ties_averaged"), name
    same, averaged = (runs[name].rollout for name in ("nothing", "ties_averaged"))
    assert np.array_equal(same.envs.visible, averaged.envs.visible)


def test_what_was_changed_stays_changed(runs):
    for name in (
        "nothing", "containers_replaced", "failures_kept", "failures_refilled", "successes_kept"
    ):  # fmt: skip
        for _ in range(150):  # as far as into the next episode, and through the memory
            runs[name].step()
    left = {name: runs[name].rollout.envs._containers.left for name in runs}
    assert left["nothing"].min() > 700 and left["containers_replaced"].min() < 600
    share = failure_share(runs["nothing"].replay)
    assert failure_share(runs["failures_refilled"].replay) < share + 0.2
    assert failure_share(runs["failures_kept"].replay) > 0.5 > share
    assert failure_share(runs["successes_kept"].replay) < 0.5


def test_moved_picks_are_the_same_in_their_order():
    old, wide, narrow = ReplayBuffer(10, 4), ReplayBuffer(20, 4), ReplayBuffer(6, 4)
    for pick in range(0, 24, 2):
        seen = np.full((2, 4, 3), pick, np.float32) + np.arange(2)[:, None, None]
        old.add(observations=seen, actions=np.array([1, 2]), rewards=np.ones(2))
    for new in (wide, narrow):
        assert changes.moved(old, new) is new
    numbers = [replay.arrays["observations"][:, 0, 0].tolist() for replay in (wide, narrow)]
    assert numbers[0][:10] == list(range(14, 24)) and len(wide) == 10
    assert set(numbers[1]) == set(range(18, 24)) and narrow.total == 10


def test_kept_picks_are_not_moved(runs):
    with pytest.raises(ValueError, match="replay keeps picks for good"):
        changes.moved(runs["failures_kept"].replay, ReplayBuffer(10, 128))


def test_a_partly_unloaded_container_has_lost_up_to_400_boxes():
    loads = [changes.partly_unloaded(np.random.default_rng(seed)) for seed in range(12)]
    sizes = np.array([len(load) for load in loads])
    assert 400 <= sizes.min() < 700 < sizes.max() <= 1000
    again = changes.partly_unloaded(np.random.default_rng(3))
    np.testing.assert_array_equal(again.positions, loads[3].positions)
