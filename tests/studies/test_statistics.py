import numpy as np
import pandas as pd
import pytest
from scipy import stats

from studies import statistics

PICKS = 20_000_000
STEP = 32_000  # picks of an episode of all environments


def curve(msr, loss=(0.5, 0.3, 0.5, 0.3)) -> pd.DataFrame:
    """A run whose MSR and loss run straight from one of the given values to the next."""
    picks = np.arange(STEP, PICKS + 1, STEP)

    def along(values):
        return np.interp(picks, np.linspace(0, PICKS, len(values)), values)

    return pd.DataFrame({"picks": picks, "success_rate": along(msr), "loss": along(loss)})


def course(msr, loss) -> pd.DataFrame:
    """A run whose windows have these means."""
    picks = statistics.WINDOW_PICKS * np.arange(1, len(msr) + 1)
    return pd.DataFrame({"picks": picks, "success_rate": msr, "loss": loss})


def test_a_window_ends_with_its_last_pick():
    run = pd.DataFrame({"picks": [1, 500_000, 500_001, 1_000_000, 1_000_001]})
    run = run.assign(success_rate=[0.0, 1.0, 0.2, 0.4, 0.9], loss=1.0)
    assert statistics.windows(run)["success_rate"].tolist() == pytest.approx([0.5, 0.3, 0.9])


def test_the_end_is_the_last_tenth():
    run = curve([0.3, 0.3])
    run.loc[run["picks"] > 18_000_000, "success_rate"] = 0.7
    assert statistics.end_msr(run) == pytest.approx(0.7)


@pytest.mark.parametrize(
    ("msr", "found"),
    [
        ([0.3, 0.9, 0.5], False),  # never high
        ([0.3, 0.96, 0.81], False),  # never low again
        ([0.3, 0.94, 0.95, 0.8, 0.3], True),
        ([0.3, 0.95, 0.9, 0.81, 0.8], True),
        ([0.3, 0.8, 0.95, 0.96, 0.98], False),  # low before
    ],
)
def test_a_fall_leads_from_high_to_low(msr, found):
    assert statistics.fell(course(msr, 0.1)) is found


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
    assert statistics.resembles_fig12(curve(msr)) is like


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
    assert statistics.resembles_fig11(curve([0.3, 0.6], loss)) is like


def test_a_cell_is_summed_up():
    runs = [
        ("a", 0, curve([0.25, 0.5, 0.6])),
        ("a", 1, curve([0.25, 0.97, 0.6])),
        ("b", 0, curve([0.2, 0.3])),
    ]
    table = statistics.cell_table(runs).set_index("cell")
    ends = [statistics.end_msr(run) for _, _, run in runs]
    assert table["runs"].tolist() == [2, 1]
    assert table["mean"].tolist() == pytest.approx([np.mean(ends[:2]), ends[2]])
    assert table.loc["a", ["fell", "fig11", "fig12", "both"]].tolist() == [1, 2, 1, 1]
    low, high = table.loc["a", ["low", "high"]]
    assert (low, high) == pytest.approx(statistics.t_interval(ends[:2]))


def test_the_interval_of_a_difference_is_welchs():
    first, second = [0.6, 0.7, 0.8, 0.5, 0.65], [0.3, 0.42, 0.35]
    found = statistics.welch_interval(first, second)
    assert found == pytest.approx((0.14426, 0.44240), abs=1e-5)  # 6.0 degrees of freedom
    assert np.isnan(statistics.welch_interval(first, [0.3])).all()


def test_the_rise_after_the_peak_of_the_loss():
    loss = [5, 1, 2, 3, 2, 2, 2]
    slow_and_noisy = course([0.1, 0.2, 0.3, 0.4, 0.5, 0.42, 0.5], loss)
    assert statistics.after_loss_peak(slow_and_noisy) == (True, True)
    fast_and_calm = course([0.1, 0.1, 0.2, 0.2, 0.4, 0.6, 0.8], loss)
    assert statistics.after_loss_peak(fast_and_calm) == (False, False)
    falling = course(np.linspace(0, 1, 7), [7, 6, 5, 4, 3, 2, 1])
    assert statistics.after_loss_peak(falling) == (False, False)


def test_share_intervals_are_those_of_the_binomial_distribution():
    """At the ends of the interval, what was seen or more extreme has a probability of 2.5 %."""
    interval = statistics.share_interval
    assert interval(0, 300) == pytest.approx((0, 1 - 0.025 ** (1 / 300)))
    assert interval(300, 300) == pytest.approx((0.025 ** (1 / 300), 1))
    low, high = interval(4, 50)
    assert stats.binom.sf(3, 50, low) == pytest.approx(0.025)
    assert stats.binom.cdf(4, 50, high) == pytest.approx(0.025)


@pytest.mark.parametrize(
    ("function", "arguments", "message"),
    [
        (statistics.bootstrap_interval, ([],), "values is empty"),
        (statistics.bootstrap_interval, ([np.nan],), "values"),
        (statistics.t_interval, ([np.inf, 1],), "values"),
        (statistics.welch_interval, ([1, 2], [np.nan, 1]), "second"),
        (statistics.share_interval, (3, 2), "count is 3"),
        (statistics.share_interval, (0, 0), "total is 0"),
    ],
)
def test_bad_values_are_refused_by_name(function, arguments, message):
    with pytest.raises(ValueError, match=message):
        function(*arguments)


def test_pairs_make_the_interval_of_a_ratio_narrow():
    reference = np.array([1.0, 5.0, 2.0, 8.0])
    ratio, low, high = statistics.ratio_interval(1.3 * reference, reference)
    assert (ratio, low, high) == pytest.approx((1.3, 1.3, 1.3))
    assert np.isnan(statistics.ratio_interval(reference, -reference)).all()
    assert np.isnan(statistics.ratio_interval(reference, np.array([-9.0, 9, 2, 0]))).all()
