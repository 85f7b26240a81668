from copy import deepcopy
from itertools import count

import numpy as np
import pandas as pd
import pytest

from tests.agent.runs import lowest
from tests.env.comparing import few_items
from unload import evaluate, policies, success_rate
from unload.env.vector import ContainerVectorEnv

COLUMNS = ["success_rate", "unloaded", "deadlocked", "longest_deadlock"]


def test_success_rate():
    for rewards, rate in (([-1.0], 0.0), (np.full((3, 4), 1), 1.0), ([1, -1, -1, -1], 0.25)):
        assert success_rate(rewards) == rate
    for rewards, message in (([], "is empty"), ([1, 0], r"holds 0\.0"), ([1, np.nan], "holds nan")):
        with pytest.raises(ValueError, match=f"rewards {message}"):
            success_rate(rewards)


def test_one_row_per_episode():
    frame, other = (evaluate(policies.random, seed=seed, max_picks=40) for seed in (1, 2))
    assert list(frame.columns) == COLUMNS and len(frame) == 20 and not frame.equals(other)
    assert (40 * frame["success_rate"]).tolist() == pytest.approx(frame["unloaded"].tolist())
    assert frame["success_rate"].between(0.05, 0.7).all()


def test_an_episode_is_the_same_whatever_is_played_beside_it():
    """Also of a policy that draws, from a generator that is not the load's."""
    loads, drawn = [], []

    def stack(rng):
        loads.append(deepcopy(rng).random())
        return few_items(rng, 200)

    def noted(observations, masks, rng):
        drawn.append(deepcopy(rng).random())
        return policies.random(observations, masks, rng)

    few = {"max_picks": 20, "stack": stack}
    many, alone = (evaluate(noted, count, 7, **few) for count in (70, 1))
    local = evaluate(noted, 2, 7, physics="local", **few)
    pd.testing.assert_frame_equal(many.loc[:0], alone)
    pd.testing.assert_frame_equal(many.loc[:1], local)
    assert many["unloaded"].nunique() > 3
    assert not {*loads} & {*drawn}


def test_the_longest_deadlock_is_the_longest_and_not_the_sum():
    calls = iter([0, 0, 0, 1, 0, 0, 0, 0, 1, 0] * 2)

    def sometimes_higher(observations, masks, rng):
        return (policies.highest if next(calls) else lowest)(observations, masks, rng)

    (row,) = evaluate(sometimes_higher, 1, mask=False, max_picks=10).to_dict("records")
    # A success forgives the failed items, so the first try after it is no deadlock.
    assert row["unloaded"] == 2
    assert row["longest_deadlock"] == 3 and row["deadlocked"] == (2 + 3) / 10


def test_the_highest_item_empties_containers_whose_loads_do_not_depend_on_their_number():
    few = evaluate(policies.highest, 2, seed=0, max_picks=None)
    many = evaluate(policies.highest, 70, max_picks=None)
    assert list(many.columns) == [*COLUMNS, "picks", "emptied"]
    assert many["emptied"].dtype == bool and many["emptied"].all()
    assert many["picks"].dtype == np.int64 and (many["picks"] == many["unloaded"]).all()
    assert (many["success_rate"] == 1).all() and many["unloaded"].between(800, 1000).all()
    assert many["unloaded"].nunique() > 20
    pd.testing.assert_frame_equal(few, many.loc[:1])


@pytest.mark.parametrize("policy", [policies.random, policies.nearest])
@pytest.mark.parametrize("mask", [False, True])
def test_each_episode_counts_to_its_own_end(policy, mask):
    counts = iter([3, 60, 20] + [5] * 99)  # the first three loads, and those that follow

    frame = evaluate(
        policy, 3, max_picks=None, mask=mask, stack=lambda rng: few_items(rng, next(counts))
    )
    assert frame["unloaded"].tolist() == [3, 60, 20] and frame["emptied"].all()
    shares = frame["unloaded"] / frame["picks"]
    assert frame["success_rate"].tolist() == pytest.approx(shares.tolist())
    assert (frame["picks"] >= frame["unloaded"]).all() and frame["picks"].nunique() == 3
    assert not mask or (frame[["deadlocked", "longest_deadlock"]] == 0).all(axis=None)


def test_an_episode_is_given_up_1280_failures_after_its_last_success():
    left = []  # items at each pick

    def policy(observations, masks, rng):
        left.append(int(masks.sum()))
        return (lowest if len(left) > 1 else policies.highest)(observations, masks, rng)

    frame = evaluate(policy, 1, mask=False, max_picks=None, stack=lambda rng: few_items(rng, 40))
    assert left.count(left[-1]) == 1280 < len(left) == frame["picks"].item()
    assert frame["longest_deadlock"].item() == 1279 and not frame["emptied"].item()


def test_what_follows_an_episode_that_was_given_up_does_not_count():
    """The first one picks what fails; and empties its container while the second one goes on."""
    calls, sizes = count(), iter([40, 800])

    def policy(observations, masks, rng):
        call = next(calls)
        low, high = (rule(observations, masks, rng) for rule in (lowest, policies.highest))
        return np.where([call < 1290, call % 2], low, high)

    frame = evaluate(
        policy, 2, mask=False, max_picks=None, stack=lambda rng: few_items(rng, next(sizes, 40))
    )
    assert frame["emptied"].tolist() == [False, True]
    assert frame["picks"].iloc[1] > 1290 + 40 and frame["unloaded"].iloc[0] < 40


@pytest.mark.parametrize("max_picks", [200, None])
def test_an_episode_ends_when_the_policy_knows_that_all_items_fail(monkeypatch, max_picks):
    look_up, none = ContainerVectorEnv._lift, np.zeros(2)
    monkeypatch.setattr(ContainerVectorEnv, "_lift", lambda *each: (look_up(*each)[0], none))
    frame = evaluate(policies.random, 2, max_picks=max_picks, stack=lambda rng: few_items(rng, 40))
    assert (frame["unloaded"] == 0).all() and (frame["deadlocked"] == 0).all()
    if max_picks is None:
        assert (frame["picks"] == 40).all() and not frame["emptied"].any()


def test_bad_arguments_are_refused():
    for given, message in (
        ({"policy": "random"}, "policy is 'random'; expected a function"),
        ({"episodes": 10**6 + 1}, "episodes is 1000001"),
        ({"mask": None}, "mask is None; expected True or False"),
    ):
        with pytest.raises((TypeError, ValueError), match=message):
            evaluate(**{"policy": policies.random, "episodes": 1} | given)


@pytest.mark.parametrize("returned", [[3.7], [128]])
def test_bad_actions_of_a_policy_are_refused_and_the_environment_closed(monkeypatch, returned):
    closed, close = [], ContainerVectorEnv.close
    monkeypatch.setattr(ContainerVectorEnv, "close", lambda env: closed.append(close(env)))
    with pytest.raises((TypeError, ValueError), match="what policy returned .* expected"):
        evaluate(lambda *_: returned, 1)
    assert len(closed) == 1
