import numpy as np
import pandas as pd
import pytest

from unload.reproduce import value_questions
from unload.reproduce.values import FRESH, FRESHER, read_values


def test_what_is_asked_of_first_falls():
    picks = 12_000_000 + 250_000 * np.arange(1, 7)
    fallen = {
        "success_rate": [1, 0.96, 0.9, 0.8, 0.7, 1],
        "blocked": [-0.5, 0, 0.25, 0.75, 1, 0.5],
        "wrong": [0, 0, 0, 0.25, 0, 0.5],
        "own_wrong": [0, 0, 0, 1, 0.5, 0],
        "start_wrong": [0, 0, 0, 0.5, 0, 0.25],
        "past_wrong": [np.nan, 0, 0, 0, 0.25, 0.75],
    }
    held = {
        "success_rate": [1, 0.97, 0.9, 0.9, 0.96, 0.9],
        "blocked": [0, 0.5, -0.75, -0.5, -1, -0.75],
        "wrong": 0,
        "own_wrong": 0,
        "start_wrong": 0,
        "past_wrong": 0,
    }
    at_once = fallen | {"success_rate": 0.5}
    table = pd.concat(
        pd.DataFrame(run).assign(change="nothing", seed=seed, picks=picks)
        for seed, run in enumerate((fallen, held, at_once))
    )
    found = value_questions.first_falls(table).set_index("seed")
    assert found["fall"].tolist()[::2] == [13_000_000, 12_250_000] and np.isnan(found["fall"][1])
    assert found["last"].tolist()[:2] == [0, -1] and np.isnan(found["last"][2])
    assert found["first"].tolist() == [-0.5, 0, -0.5]
    assert found["highest"].tolist() == [1, -0.75, 1]  # from 13.25 million picks on
    assert found["wrong"].tolist()[::2] == [0.25, 0]
    assert found["own_wrong"].tolist()[::2] == [0.5, 0]
    assert found["start_wrong"].tolist()[::2] == [0.25, 0]
    assert found["past_wrong"].tolist()[0] == 0.75  # 256,000 picks after the others


def found(change, seeds, **columns):
    """Rows as ``first_falls`` returns them."""
    return pd.DataFrame({"change": change, "seed": list(seeds), **columns})


@pytest.mark.parametrize(("last", "status"), [([0, 0.4, 1], "shown"), ([0, 0.2, 1], "refuted")])
def test_values_must_rise_in_each_run(last, status):
    fresh = found("nothing", [10, 11], first=0.0, last=np.nan)
    foretold = found("nothing", value_questions.FORETOLD, first=[-0.5, 0, 0.5], last=last)
    answer = value_questions.values_rise(pd.concat([fresh, foretold]))
    assert answer.status == status and answer.so_far.startswith("By +0.50, +0.")


@pytest.mark.parametrize(("highest", "status"), [(-0.95, "shown"), (-0.85, "refuted")])
def test_values_must_stay_low_in_each_run(highest, status):
    seeds = value_questions.FORETOLD
    table = [
        found("failures_kept", seeds, highest=-0.99),
        found("successes_called_failures", seeds, highest=[-1, highest, -0.93]),
        found("successes_called_failures", [0], highest=0.0),  # not foretold
        found("nothing", seeds, highest=1.0),
    ]
    assert value_questions.values_held_down(pd.concat(table)).status == status


QUESTIONS = {
    value_questions.earlier_states: ("wrong", FRESH, 0.1),
    value_questions.earlier_network: ("start_wrong", FRESHER, 0.2),
    value_questions.later_network: ("past_wrong", FRESHER, 0.2),
}


@pytest.mark.parametrize("question", QUESTIONS)
@pytest.mark.parametrize(("above", "status"), [(1, "shown"), (2, "refuted")])
def test_one_fall_may_be_otherwise(question, above, status):
    name, seeds, most = QUESTIONS[question]
    shares = [most] * (4 - above) + [most + 0.01] * above
    fell = found("nothing", seeds[:4], fall=12e6, own_wrong=0.4, **{name: shares})
    held = found("nothing", seeds[4:5], fall=np.nan, own_wrong=np.nan, **{name: np.nan})
    others = found("nothing", [3], fall=12e6, own_wrong=0.4, **{name: 0.4})
    answer = question(pd.concat([fell, held, others]))
    assert answer.status == status and f"in {4 - above} of 4 falls" in answer.so_far


def test_the_data_answer_what_the_deviations_ask():
    found = value_questions.value_answers(read_values())
    assert [each.status for each in found] == ["refuted"] + 4 * ["shown"]
