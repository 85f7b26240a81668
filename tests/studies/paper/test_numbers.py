"""The paper's numbers beside ours."""

import gymnasium
import numpy as np
import pytest

from studies.paper import numbers
from studies.paper.numbers import Row
from unload import policies, task
from unload.agent.evaluation import evaluate
from unload.physics.situation import Surroundings


def test_a_table_says_in_words_what_agrees():
    rows = [
        Row("a", "I", "1", "1", np.True_),
        Row("b", "I", "1", "2", False),
        Row("c", "—", "—", "3"),
        Row("d", "I", "1", "0 to 9", "in part"),
    ]
    table = numbers.table(rows)
    assert table["agrees"].to_dict() == {"a": "yes", "b": "no", "c": "", "d": "in part"}
    assert list(table.columns) == ["source", "paper", "here", "agrees"]


def test_all_constants_are_those_of_the_paper():
    constants = numbers.constants()
    assert len(constants) == 24 and (constants["agrees"] == "yes").all()
    assert constants.loc["training steps K", "paper"] == "20000000"


def test_another_constant_does_not_agree(monkeypatch):
    monkeypatch.setattr(task, "PICK_FORCE", 30.0)
    constants = numbers.constants()
    assert constants.index[constants["agrees"] == "no"].tolist() == ["force (N)"]
    assert constants.loc["force (N)", "here"] == "30.0"


def test_loads_lifts_and_ranks_agree():
    table = numbers.loads_and_lifts(np.random.default_rng(0), 3)
    assert (table["agrees"] == "yes").all() and len(table) == 5
    assert table.loc["Tab. I", "paper"] == "-1.00 -0.33 -0.66 0.66 0.33 0.00 1.00"


def test_values_instead_of_ranks_do_not_agree(monkeypatch):
    monkeypatch.setattr(numbers, "equalize", lambda values: values)
    table = numbers.loads_and_lifts(np.random.default_rng(0), 1)
    assert table.index[table["agrees"] == "no"].tolist() == ["Tab. I"]


def test_a_stack_is_lifted_less_the_higher_it_is():
    one, two, three = map(numbers.lifted_distance, (1, 2, 3))
    assert one > task.LIFT_THRESHOLD > two > three


def test_free_items_are_counted_in_full_containers():
    free, visible = numbers.free_shares(1)
    env = gymnasium.make("unload/Container-v0", physics="table").unwrapped
    env.reset(seed=0)
    load = env.physics.load
    blocked = [
        bool(Surroundings(load, np.ones(len(load), bool)).on_top(i)) for i in range(len(load))
    ]
    assert free == pytest.approx(1 - np.mean(blocked))
    assert visible == env.liftable().mean() > free
    env.close()


def test_random_picks_and_rules_are_evaluated_without_the_mask():
    random = evaluate(policies.random, 2, 5, mask=False)["success_rate"]
    chance = numbers.chance(2, 5)
    assert chance.loc["MSR of random picks", "here"].startswith(f"{random.mean():.1%} ± ")
    free = numbers.free_shares(2)[0]
    assert chance.loc["items with nothing on top", "here"] == f"{free:.1%}"
    rules = numbers.rules(1, 0)
    assert rules.loc["MSR of an optimal policy"].tolist()[2:] == ["highest item: 100.0%", "yes"]
