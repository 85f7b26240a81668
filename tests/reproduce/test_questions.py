"""The plan's questions: each of its criteria, on runs that meet it and on runs that do not."""

import numpy as np
import pandas as pd
import pytest

from unload.reproduce import questions
from unload.reproduce.answer import read_answer, seeds_of
from unload.reproduce.interventions import FAILURES, read_interventions

PICKS, STEP = 20_000_000, 100_000
STEADY, FALLEN, KEPT = [0.25, 0.5, *[0.6] * 8], [0.25, 1, 1, 0.5], [0.25, 0.9, 1, 1]
HUMP = [0.5, 0.3, 0.5, 0.3]  # of the loss, as in the paper's Fig. 11


def curve(msr, shift=0.0) -> pd.DataFrame:
    """A run whose MSR runs straight from one of the given values to the next."""
    picks = np.arange(STEP, PICKS + 1, STEP)

    def along(values):
        return np.interp(picks, np.linspace(0, PICKS, len(values)), values)

    rate = np.clip(along(msr) + shift, 0, 1)
    return pd.DataFrame({"picks": picks, "success_rate": rate, "loss": along(HUMP)})


def cell(name, msr, runs=None):
    """Runs of a cell, as many as planned, whose MSRs lie slightly apart."""
    shifts = np.linspace(-0.01, 0.01, runs or len(seeds_of(name)))
    return [(name, seed, curve(msr, shift)) for seed, shift in enumerate(shifts)]


def cells(**msr):
    return questions.measured(run for name, each in msr.items() for run in cell(name, each))


PAPER = {name: KEPT for name in questions.PAPER_CELLS}


@pytest.mark.parametrize(
    ("changed", "status"),
    [
        ({"paper_mask": STEADY}, "shown"),
        ({"paper_mask": [0.25, 0.9, *[0.6] * 8]}, "partly shown"),  # no steady rise
        ({}, "refuted"),
    ],
)
def test_whether_the_60_percent_are_reproduced(changed, status):
    assert questions.reproduced(cells(**PAPER | changed)).status == status


def test_missing_runs_are_said():
    few = questions.measured(cell("paper_mask", STEADY, 3))
    answer = questions.reproduced(few)
    assert answer.status == "shown so far"
    assert "3 of 10 runs, 3 of them at 50% to 70%, 3 like the paper's" in answer.so_far
    assert "Still missing: without the mask, b = 256;" in answer.so_far
    assert questions.reproduced({}).status == "still running"


def test_the_mask_matters_if_one_interval_is_away_from_0():
    same, apart = cells(**PAPER), cells(**PAPER | {"paper_no_mask": STEADY})
    assert questions.mask_matters(same).status == "refuted"
    assert questions.mask_matters(apart).status == "shown"
    del same["paper_b2048_mask"]
    assert questions.mask_matters(same).status == "not shown so far"
    assert "b = 2048: too few (0 of 8 runs and 8 of 8 runs)" in questions.mask_matters(same).so_far


def test_the_batch_is_judged_for_each_setting_of_the_mask():
    table = cells(**PAPER | {"paper_b2048_mask": STEADY})
    assert questions.batch_matters(table, "no_mask").status == "refuted"
    answer = questions.batch_matters(table, "mask")
    assert answer.status == "shown"
    low, high = answer.so_far.split("(")[1].split(";")[0].split(" to ")
    assert float(low) < float(high) < -30


@pytest.mark.parametrize(
    ("ordered", "averaged", "status"),
    [(KEPT, KEPT, "shown"), (FALLEN, KEPT, "refuted"), (KEPT, FALLEN, "not shown")],
)
def test_random_ties(ordered, averaged, status):
    table = cells(
        ties_by_order_mask=KEPT,
        ties_by_order_no_mask=ordered,
        ties_averaged_mask=KEPT,
        ties_averaged_no_mask=averaged,
    )
    assert questions.random_ties(table).status == status


@pytest.mark.parametrize(("msr", "status"), [(KEPT, "shown"), (STEADY, "refuted")])
def test_distinct_ranks(msr, status):
    names = "ties_averaged_no_mask", "ties_averaged_mask", "positions_no_mask", "positions_mask"
    table = cells(**dict.fromkeys(names, KEPT) | {"positions_mask": msr})
    assert questions.distinct_ranks(table).status == status
    assert questions.distinct_ranks({}).status == "still running"


def changed(name, msr, runs=10):
    """Control runs that were changed after 12 million picks."""
    found = cell(name, msr, runs)
    for *_, each in found:
        each[FAILURES] = np.where(each["picks"] <= 12_000_000, np.nan, 0.1)
    return found


LATE_FALL = [0.25, 0.9, 1, 1, 0.5]


def test_interventions_are_compared_with_the_control():
    early = [0.25, 1, 0.5, 1, 0.5]  # has fallen before
    runs = changed("nothing", LATE_FALL) + changed("memory_23", KEPT) + changed("nothing", early, 3)
    table = questions.intervention_table(runs).set_index("change")
    assert table.loc["nothing", ["runs", "fell"]].tolist() == [10, 10]
    assert table.loc["memory_23", ["runs", "fell"]].tolist() == [10, 0]
    assert table.loc["memory_23", "p"] == pytest.approx(1 / 184756)  # one of 20 over 10
    assert questions.intervention_table([]).empty


def test_forgetting_is_shown_by_the_planned_interventions_only():
    runs = [run for name in PAPER for run in cell(name, LATE_FALL)]
    helped = [
        run
        for name, msr in (("nothing", LATE_FALL), ("memory_23", KEPT), ("failures_refilled", KEPT),
                          ("containers_replaced", LATE_FALL))
        for run in changed(name, msr)
    ]  # fmt: skip
    for *_, each in runs:  # hardly any failure in the replay, whatever the falls look like
        each.loc[(each["picks"] > 9_000_000) & (each["success_rate"] > 0.96), "success_rate"] = 1
    falls = questions.paper_falls(runs)
    assert (falls["failures"] < questions.MANY).all()
    assert questions.forgetting(runs).status == "not shown so far"
    assert questions.forgetting(runs, helped).status == "shown"
    others = [(name, seed, each) for name, seed, each in helped if name != "containers_replaced"]
    assert (
        questions.forgetting(runs, others + changed("containers_replaced", KEPT)).status
        == "refuted"
    )


def test_forgetting_is_refuted_by_falls_among_many_failures():
    runs = [run for name in PAPER for run in cell(name, [0.25, 0.25, 0.97, 0.3])]
    assert (questions.paper_falls(runs)["failures"] > questions.MANY).all()
    assert questions.forgetting(runs).status == "refuted so far"
    assert questions.forgetting([]).status == "still running"


def test_the_smallest_change_is_asked_of_ten_runs():
    high = [0.25, 1.05, 1.05, 1.05]  # cut off at 1
    assert questions.smallest_change(cell("memory_23_mask", high, 10)).status == "shown"
    assert questions.smallest_change(cell("memory_23_mask", high, 5)).status == "not shown so far"
    every = [run for name in questions.MEMORIES for run in cell(name, FALLEN)]
    assert questions.smallest_change(every).status == "refuted"
    assert questions.smallest_change([]).status == "still running"


@pytest.mark.parametrize(
    ("failures", "successes", "status"),
    [
        (KEPT, LATE_FALL, "shown"),
        (KEPT, KEPT, "refuted"),
        (LATE_FALL, LATE_FALL, "refuted"),
        (KEPT, None, "shown so far"),
    ],
)
def test_whether_failures_are_what_matters(failures, successes, status):
    runs = changed("nothing", LATE_FALL) + changed("failures_kept", failures)
    runs += changed("successes_kept", successes) if successes else []
    assert questions.failures_matter(runs).status == status
    assert questions.failures_matter([]).status == "still running"
    without_control = [run for run in runs if run[0] != "nothing"]
    assert questions.failures_matter(without_control).status == "still running"


@pytest.mark.parametrize(("called", "status"), [(KEPT, "shown"), (LATE_FALL, "not shown")])
def test_whether_false_failures_are_enough(called, status):
    runs = changed("nothing", LATE_FALL) + changed("successes_kept", LATE_FALL)
    assert questions.false_failures_are_enough(runs).status == "still running"
    runs += changed("successes_called_failures", called)
    assert questions.false_failures_are_enough(runs).status == status


@pytest.mark.parametrize(
    ("falling", "status"), [(0, "shown"), (1, "shown"), (2, "not shown"), (4, "not shown")]
)
def test_whether_more_updates_prevent_falls(falling, status):
    name = "updates_16_mask"
    runs = [(name, 0, curve(LATE_FALL))]  # had been seen, and does not count
    assert questions.update_answers(runs)[1].status == "still running"
    runs += cell("paper_mask", LATE_FALL)
    runs += [(name, seed, curve(LATE_FALL if seed <= falling else KEPT)) for seed in range(1, 5)]
    few, many = questions.update_answers(runs)
    assert few.status == "still running"
    assert many.status == status and many.so_far.startswith(f"{falling} of 4 fresh runs fall")
    assert questions.update_answers(runs[:-1])[1].status.endswith("so far")


@pytest.mark.parametrize("name", questions.FROM_THE_BEGINNING)
def test_what_is_changed_from_the_beginning_holds_every_run(name):
    high = [0.25, 1.05, 1.05, 1.05]
    assert questions.held_from_the_beginning(cell(name, high), name).status == "shown"
    assert questions.held_from_the_beginning(cell(name, high, 4), name).status == "shown so far"
    one_low = cell(name, high, 9) + cell(name, LATE_FALL, 1)
    answer = questions.held_from_the_beginning(one_low, name)
    assert answer.status == "refuted" and "9 of 10 runs" in answer.so_far
    short = cell(name, high)
    for *_, curve_of_2m in short:
        curve_of_2m["picks"] //= 10
    assert questions.held_from_the_beginning(short, name).status == "still running"
    assert questions.held_from_the_beginning([], name).status == "still running"


def test_all_questions_are_answered_by_the_data():
    found = questions.answers(read_answer(), read_interventions())
    assert len(found) == 13
    assert all(each.status.removesuffix(" so far") in questions.STATUSES for each in found)
    assert all(each.so_far.endswith(".") for each in found)
