import numpy as np
import pytest

from unload.heap.episodes import Oracle, episode_from, exploring, outcomes, picks_of, play
from unload.heap.rules import RULES


def test_an_episode_holds_what_was_seen_and_done(make_heap_env, pile):
    env = make_heap_env(max_picks=4)
    episode = play(env, RULES["lowest"], pile, 0, keep_heaps=True)
    assert len(episode.actions) == 4 and len(episode.observations) == len(episode.masks) == 5
    assert episode.heaps[0] is pile and len(episode.heaps) == 5
    left = [len(heap) for heap in episode.heaps]
    assert (-np.diff(left)).tolist() == episode.unloaded.tolist()
    observation, info = env.reset(options={"heap": episode.heaps[2]})
    assert observation.tobytes() == episode.observations[2].tobytes()
    assert np.array_equal(info["item_mask"], episode.observations[2].any(axis=1))


def test_the_same_seed_gives_the_same_episode(make_heap_env, pile):
    first, second = (
        play(make_heap_env(max_picks=4), RULES["random"], pile, seed) for seed in (7, 7)
    )
    assert first.actions.tolist() == second.actions.tolist()
    assert first.observations.tobytes() == second.observations.tobytes()


def test_stored_episodes_are_the_same(make_heap_env, pile):
    episode = play(make_heap_env(max_picks=3), RULES["random"], pile, 0)
    arrays = episode.arrays()
    assert arrays["observations"].shape[1] < 96
    again = episode_from(arrays)
    for name in ("observations", "masks", "actions", "boxes", "unloaded", "falls", "moved"):
        assert np.array_equal(getattr(again, name), getattr(episode, name)), name


def test_picks_are_transitions(make_heap_env, cubes):
    episode = play(make_heap_env(), RULES["highest"], cubes((5, 1, 0), (5, 1, 1)), 0)
    picks = picks_of(episode)
    assert len(picks) == len(episode.actions)
    assert np.array_equal(picks.next_observations[0], picks.observations[1])
    assert not picks.next_masks[-1].any(), "the heap is empty at the end"
    assert picks.unloaded.sum() == 2


def test_outcomes_of_an_episode_are_those_that_were_played(make_heap_env, make_rake, pile):
    episode = play(make_heap_env(max_picks=3), RULES["lowest"], pile, 0, keep_heaps=True)
    found = outcomes(episode, make_rake("coarse"))
    assert [int(one.unloaded.sum()) for one in found] == episode.unloaded.tolist()
    assert [int(one.fallen.sum()) for one in found] == episode.falls.tolist()
    assert [one.moved for one in found] == episode.moved.tolist()
    with pytest.raises(ValueError, match="other physics than the episode's; it is whole"):
        outcomes(episode, make_rake("whole"))
    with pytest.raises(ValueError, match="episode holds no heaps"):
        outcomes(play(make_heap_env(), RULES["lowest"], pile, 0), make_rake("coarse"))


def test_exploring_picks_half_at_random_and_half_as_its_favourite(rng):
    observations = np.ones((1, 96, 13))
    masks = np.ones((1, 96))

    def favourite(observations, masks, rng):
        return np.array([5])

    policy = exploring(rng, favourite)
    rows = np.array([policy(observations, masks, rng)[0] for _ in range(400)])
    assert 0.4 < (rows == 5).mean() < 0.6
    assert len(np.unique(rows)) > 60


def test_the_oracle_picks_the_box_that_brings_most(make_heap_env, cubes):
    """Of a row of three and a single box, the rear one of the row brings all three."""
    heap = cubes((4.8, 0.5, 0), (5.21, 0.5, 0), (5.62, 0.5, 0), (5.62, 2.0, 0))
    env = make_heap_env(heaps=[heap])
    for again in (None, "whole"):
        oracle = Oracle(env, falls_weight=1.0, again=again)
        episode = play(env, oracle, heap, 0)
        oracle.close()
        assert int(episode.boxes[0]) == 0 and episode.unloaded[0] == 3


def test_an_oracle_that_tries_again_believes_the_second_physics(make_heap_env, cubes, monkeypatch):
    """A first physics in which all boxes look alike leaves the choice to the second."""
    heap = cubes((5.62, 2.0, 0), (4.8, 0.5, 0), (5.21, 0.5, 0), (5.62, 0.5, 0))
    env = make_heap_env(heaps=[heap])
    oracle = Oracle(env, falls_weight=1.0, again="coarse")
    nothing = oracle._rakes[0].pick(cubes((4.5, 1, 0)), 0)
    monkeypatch.setattr(oracle._rakes[0], "pick", lambda heap, box: nothing)
    episode = play(env, oracle, heap, 0)
    oracle.close()
    assert int(episode.boxes[0]) == 1 and episode.unloaded[0] == 3


def test_bad_input_is_refused(make_heap_env, pile):
    env = make_heap_env()
    with pytest.raises(ValueError, match="seed is -1"):
        play(env, RULES["lowest"], pile, -1)
    with pytest.raises(ValueError, match="falls_weight is -1"):
        Oracle(env, -1)
