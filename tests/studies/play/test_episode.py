"""Episodes, and those that the moving picture shows; test_published.py compares the picture."""

import numpy as np
import pytest

import unload
from studies.play.episode import Episode, Run
from tests.env.comparing import make_env


@pytest.fixture
def episode(full_load):
    return Episode(full_load, 3)


def test_picks_are_those_of_the_environment(full_load, episode):
    env = make_env().unwrapped
    observation, info = env.reset(seed=3, options={"load": full_load})
    for row in (0, 20, 20, 40, 60, 5):
        assert np.array_equal(episode.observation, observation)
        assert np.array_equal(episode.allowed(), info["action_mask"])
        assert np.array_equal(episode.visible, env.visible)
        deadlocked = info["action_mask"][row] == 0
        observation, reward, _, _, info = env.step(row)
        pick = episode.pick(int(episode.visible[row]))
        assert (pick.item, pick.distance) == (info["item"], info["distance"])
        assert (pick.success, pick.deadlocked) == (reward > 0, deadlocked)
    assert episode.unloaded() == info["unloaded"] == episode.unloaded(6)
    drawn = Episode(None, 3)
    assert np.array_equal(drawn.observation, make_env().unwrapped.reset(seed=3)[0])
    assert len(drawn.load) == len(unload.stack_load(np.random.default_rng(3)))


def test_a_pick_names_what_rests_on_it_and_fails_until_the_next_success(boxes):
    tower = Episode(boxes((1.0, 0.2), (1.0, 0.6), (1.0, 1.0), (2.0, 0.2)), 0)
    assert [tower.pick(item).on_top for item in (1, 0)] == [(2,), (1, 2)]
    assert tower.moment().failed.tolist() == [0, 1]
    groups = tower.moment().groups()
    assert groups["failed"].tolist() == [0] and groups["tried"].tolist() == [0, 1]
    assert tower.pick(0).deadlocked and tower.moment().failed.tolist() == [0, 1]
    assert [tower.pick(item).on_top for item in (3, 2)] == [(), ()]
    assert tower.moment().failed.tolist() == [] and "failed" not in tower.moment().groups()
    again = tower.pick(0)
    assert not again.deadlocked and again.on_top == (1,) and tower.unloaded() == 2


def test_moments_are_remembered_and_picks_can_be_taken_back(episode):
    def now() -> tuple:
        return episode.observation.copy(), episode.allowed().copy(), episode.visible

    seen, moments = [now()], [episode.moment()]
    for row in (3, 77, 50, 10, 100):
        episode.pick(int(episode.visible[row]))
        seen.append(now())
        moments.append(episode.moment())
    for count, then in enumerate(moments):
        moment = episode.moment(count)
        for name in ("present", "visible", "failed"):
            assert np.array_equal(getattr(moment, name), getattr(then, name))
        assert moment.pick == then.pick
    assert np.array_equal(episode.visible, moments[-1].visible)
    assert (~moments[-1].present).sum() == episode.unloaded()
    picks = episode.picks.copy()
    for count in (5, 2, 0):
        episode.back_to(count)
        assert episode.picks == picks[:count]
        assert all(map(np.array_equal, now(), seen[count]))
    assert [episode.pick(pick.item) for pick in picks] == picks


def test_a_run_is_the_same_however_it_is_played(full_load):
    at_once, in_parts = (Run("random", full_load, seed=2) for _ in range(2))
    at_once.play_to(30)
    for count in (7, 3, 20, 30):
        in_parts.play_to(count)
    assert in_parts.picks == at_once.picks
    in_parts.back_to(10)
    in_parts.play_to(30)
    assert in_parts.picks == at_once.picks


def test_a_random_player_draws_another_row_at_each_pick(full_load):
    run, rows = Run("random", full_load, seed=2, mask=False), []
    for count in range(1, 31):
        rows.append(run.visible.tolist().index(run.choose()))
        run.play_to(count)
    assert len(set(rows)) > 20
