import numpy as np
import pandas as pd
import pytest
from scipy import stats

from unload.reproduce import verdict

PICKS = 20_000_000
STEP = 32_000  # picks of an episode of all environments


def curve(msr, loss=(0.5, 0.3, 0.5, 0.3)) -> pd.DataFrame:
    """A run whose MSR and loss run straight from one of the given values to the next."""
    picks = np.arange(STEP, PICKS + 1, STEP)

    def along(values):
        return np.interp(picks, np.linspace(0, PICKS, len(values)), values)

    return pd.DataFrame({"picks": picks, "success_rate": along(msr), "loss": along(loss)})


def test_the_end_is_the_last_tenth():
    run = curve([0.3, 0.3])
    run.loc[run["picks"] > 18_000_000, "success_rate"] = 0.7
    assert verdict.end_msr(run) == pytest.approx(0.7)


@pytest.mark.parametrize(
    ("msr", "count"),
    [
        ([0.3, 0.9, 0.5], 0),  # never high
        ([0.3, 0.96, 0.81], 0),  # never low again
        ([0.3, 0.95, 0.9, 0.8, 0.3], 1),
        ([0.96, 0.5, 0.6, 0.97, 0.7], 2),
        ([0.96, 0.5, 0.4, 0.9, 0.4], 1),
    ],
)
def test_a_fall_leads_from_high_to_low(msr, count):
    assert verdict.falls(msr) == count


@pytest.mark.parametrize(
    ("msr", "like"),
    [
        ([0.25, 0.5, 0.6], True),
        ([0.25, 0.5, 0.9], False),  # too good
        ([0.25, 0.3, 0.35], False),  # too bad
        ([0.25, 0.9, 0.6], False),  # no steady rise
        ([0.5, 0.55, 0.6], False),  # hardly a rise
    ],
)
def test_what_is_like_fig_12(msr, like):
    assert verdict.resembles_fig12(curve(msr)) is like


@pytest.mark.parametrize(
    ("loss", "like"),
    [
        ([0.5, 0.3, 0.5, 0.3], True),
        ([0.5, 0.3, 0.3], False),  # never rises
        ([0.5, 0.3, 0.5], False),  # never falls again
        ([0.5, 0.49, 0.5, 0.3], False),  # rises by too little
    ],
)
def test_what_is_like_fig_11(loss, like):
    assert verdict.resembles_fig11(curve([0.3, 0.6], loss)) is like


def test_intervals_hold_the_mean_as_often_as_they_say():
    """The t interval of five normally distributed values; the bootstrap's held it in 84 %."""
    rng = np.random.default_rng(0)
    draws = rng.normal(0.6, 0.1, (2000, 5))
    inside = [low <= 0.6 <= high for low, high in map(verdict.t_interval, draws)]
    assert np.mean(inside) == pytest.approx(0.95, abs=0.02)


def test_the_interquartile_mean_leaves_out_both_ends():
    assert verdict.interquartile_mean([0, 1, 2, 3, 4, 5, 6, 100]) == 3.5
    values = stats.norm.ppf(np.linspace(0.05, 0.95, 10))
    low, high = verdict.bca_interval(values)
    assert low < 0 < high
    assert verdict.bca_interval(values) == (low, high)


@pytest.mark.parametrize("interval", [verdict.t_interval, verdict.bca_interval])
def test_too_few_values_have_no_interval(interval):
    assert np.isnan(interval([0.6])).all()


def test_a_cell_is_summed_up():
    runs = [
        ("a", 0, curve([0.25, 0.5, 0.6])),
        ("a", 1, curve([0.25, 0.97, 0.6])),
        ("b", 0, curve([0.2, 0.3])),
    ]
    table = verdict.cell_table(runs).set_index("cell")
    ends = [verdict.end_msr(run) for _, _, run in runs]
    assert table["runs"].tolist() == [2, 1]
    assert table["mean"].tolist() == pytest.approx([np.mean(ends[:2]), ends[2]])
    assert table.loc["a", ["fell", "fig11", "fig12", "both"]].tolist() == [1, 2, 1, 1]
    low, high = table.loc["a", ["low", "high"]]
    assert (low, high) == pytest.approx(verdict.t_interval(ends[:2]))
