"""The measures of the plan."""

import numpy as np
import pandas as pd
import pytest

from studies.seamless import verdicts

PICKS = np.arange(1, 626) * 32_000


def run(msr, loss=0.3) -> pd.DataFrame:
    """A curve of 20 million picks, of numbers at equal distances."""
    place = np.linspace(0, 1, len(PICKS))
    values = {
        name: np.interp(place, np.linspace(0, 1, np.size(each)), np.atleast_1d(each))
        for name, each in (("success_rate", msr), ("loss", loss))
    }
    return pd.DataFrame({"picks": PICKS, **values})


def test_a_run_starts_in_its_first_episode_and_ends_in_its_last_tenth():
    found = verdicts.measures(run([0.2, *[0.5] * 8, 0.8, 0.8]))
    assert found["start"] == pytest.approx(0.2)
    assert found["end"] == pytest.approx(0.8, abs=1e-3)
    assert found["best"] == pytest.approx(0.8) and found["drop"] == 0


@pytest.mark.parametrize(
    ("msr", "like"),
    [
        ([0.15, 0.6, 0.6], True),
        ([0.26, 0.6, 0.6], False),  # the start
        ([0.15, 0.6, 0.75], False),  # the end
        ([0.15, 0.6, 0.45], False),
        ([0.15, 0.6, 0.56, 0.6], True),  # four points down
        ([0.15, 0.6, 0.53, 0.6], False),
    ],
)
def test_a_run_is_like_fig_12_by_start_end_and_rise(msr, like):
    assert verdicts.measures(run(msr))["fig12"] is like


@pytest.mark.parametrize(
    ("loss", "like"),
    [
        ([0.3, 0.2, *np.linspace(0.2, 0.5, 20), 0.45], True),
        ([0.2, *np.linspace(0.2, 0.5, 20), 0.45], False),  # does not fall first
        ([0.3, 0.2, *np.linspace(0.2, 0.5, 20), *[0.3] * 8], False),  # sinks by more than half
        ([0.3, 0.2, *np.linspace(0.2, 0.5, 20)], True),
        ([0.5, 0.4, 0.3, 0.2], False),  # does not rise
    ],
)
def test_a_run_is_like_fig_11_by_its_loss(loss, like):
    assert verdicts.like_fig11(run(0.5, loss)) is like


def test_runs_are_counted_by_cell():
    curves = pd.concat(
        run([0.15, end, end]).assign(cell="mask_order", seed=seed)
        for seed, end in ((40, 0.5), (41, 0.6), (42, 0.9))
    )
    row = verdicts.by_cell(verdicts.by_run(curves)).loc["mask_order"]
    assert (row["runs"], row["fig12"], row["steady"]) == (3, 2, 3)
    assert row["lowest"] == pytest.approx(0.5) and row["highest"] == pytest.approx(0.9)
    assert row["end"] == pytest.approx(2 / 3, abs=1e-3)
    assert row["low"] < row["end"] < row["high"]
