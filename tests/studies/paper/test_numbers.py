"""The paper's numbers beside ours."""

import numpy as np
import pandas as pd
import pytest

from studies.paper import numbers
from tests.studies.curves import course
from unload import policies
from unload.agent.evaluation import evaluate


def test_a_table_says_in_words_what_agrees():
    agreeing = {"a": np.True_, "b": False, "c": None, "d": "in part"}
    table = numbers.table([(name, "I", "1", 2, agrees) for name, agrees in agreeing.items()])
    assert table["agrees"].to_dict() == {"a": "yes", "b": "no", "c": "", "d": "in part"}
    assert table.loc["a"].tolist() == ["I", "1", "2", "yes"]


def test_all_constants_are_those_of_the_paper():
    constants = numbers.constants()
    assert len(constants) == 25 and (constants["agrees"] == "yes").all()


def test_what_is_measured_agrees_where_it_should(monkeypatch):
    monkeypatch.setattr(numbers, "CONTAINERS", 2)
    table = numbers.measured(3, 2, 5)
    free = numbers.full_containers(2)["free"].mean()
    assert table.loc["items with nothing on top", "here"] == f"{free:.1%}"
    random = evaluate(policies.random, 2, 5, mask=False)["success_rate"]
    assert table.loc["MSR of random picks", "here"].startswith(f"{random.mean():.1%} ± ")
    assert table.loc["MSR of an optimal policy", "here"] == "highest item: 100.0%"
    assert table["agrees"].tolist() == ["yes"] * 4 + ["no", "", "no", "", "no", "yes", ""]
    # Values instead of ranks do not agree, nor do lifts that differ by a little.
    monkeypatch.setattr(numbers, "equalize", lambda values: values)
    monkeypatch.setattr(numbers, "lifted_distance", lambda stack: {1: 0.466, 2: 0.0096}[stack])
    monkeypatch.setattr(numbers, "CHANCE_ERROR", 0.1)
    agrees = numbers.measured(1, 1, 5)["agrees"]
    assert agrees.tolist()[1:4] == ["no"] * 3 and agrees["MSR of random picks"] == "yes"


# Of ten million picks: it falls, rises and falls.
LOSS = np.r_[np.linspace(1, 0.1, 7), np.linspace(0.1, 0.8, 7), np.linspace(0.8, 0.2, 6)]
RISE, WAVES = np.linspace(0.15, 0.5, 14), 0.02 * np.resize([1, -1], 6)
COURSES = {  # of two or three runs, and what agrees
    "like the paper's": (
        [np.r_[RISE, np.linspace(0.55, end, 6) + WAVES] for end in (0.61, 0.62, 0.63)],
        ["yes"] * 6,
    ),
    "of the same mean alone": (
        [np.r_[np.linspace(0.3, 1, 15), np.full(5, 0.3)], np.linspace(0.3, 0.9, 20)],
        ["no", "in part", "yes", "yes", "yes", "yes"],
    ),
    "of another mean": (
        [np.linspace(0.15, end, 20) for end in (0.67, 0.68, 0.69)],
        ["yes", "no", "yes", "no", "yes", "yes"],
    ),
}


@pytest.mark.parametrize("name", COURSES)
def test_runs_agree_with_the_paper_by_the_plan(name, monkeypatch):
    rates, agree = COURSES[name]
    runs = [course(msr, LOSS).assign(cell="paper_mask", seed=i) for i, msr in enumerate(rates)]
    monkeypatch.setattr(numbers, "read_grid", lambda *_, **__: pd.concat(runs))
    found = numbers.training()["with the mask, b = 256"]
    assert [text.rpartition(": ")[2] for text in found] == agree
