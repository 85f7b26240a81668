"""The paper's numbers beside ours."""

import numpy as np
import pandas as pd
import pytest

from studies.paper import numbers
from tests.studies.curves import course


def test_what_differs_does_not_agree(monkeypatch):
    """Neither values instead of ranks nor lifts that differ by a little."""
    monkeypatch.setattr(numbers, "CONTAINERS", 2)
    monkeypatch.setattr(numbers, "equalize", lambda values: values)
    monkeypatch.setattr(numbers, "lifted_distance", lambda stack: {1: 0.466, 2: 0.0096}[stack])
    monkeypatch.setattr(numbers, "CHANCE_ERROR", 0.1)
    agrees = numbers.measured(1, 1, 5)["agrees"]
    assert agrees.tolist()[1:4] == ["no"] * 3 and agrees["MSR of random picks"] == "yes"


# Of ten million picks: it falls, rises and falls.
LOSS = np.r_[np.linspace(1, 0.1, 7), np.linspace(0.1, 0.8, 7), np.linspace(0.8, 0.2, 6)]
RISE, WAVES = np.linspace(0.15, 0.5, 14), 0.02 * np.resize([1, -1], 6)
COURSES = {  # of three runs, and what agrees
    "like the paper's": (
        [np.r_[RISE, np.linspace(0.55, end, 6) + WAVES] for end in (0.61, 0.62, 0.63)],
        ["yes"] * 6,
    ),
    "of a higher mean": (
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
