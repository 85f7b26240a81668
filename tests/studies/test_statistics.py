import numpy as np
import pandas as pd
import pytest
from scipy import stats

from studies import statistics
from studies.statistics import fell, resembles_fig11, resembles_fig12


def course(msr, loss) -> pd.DataFrame:
    """A run whose windows of half a million picks have these means."""
    picks = np.arange(1, len(msr) + 1) * 500_000
    return pd.DataFrame({"picks": picks, "success_rate": msr, "loss": loss})


def curve(msr, loss=(0.5, 0.3, 0.5, 0.3)) -> pd.DataFrame:
    """A run of 20 million picks, its MSR and loss straight from one given value to the next."""
    place = np.linspace(0, 1, 40)
    return course(*(np.interp(place, np.linspace(0, 1, len(ends)), ends) for ends in (msr, loss)))


def test_a_window_ends_with_its_last_pick():
    run = pd.DataFrame({"picks": [1, 500_000, 500_001, 1_000_000, 1_000_001]})
    run = run.assign(success_rate=[0.0, 1.0, 0.2, 0.4, 0.9], loss=1.0)
    assert statistics.windows(run)["success_rate"].tolist() == pytest.approx([0.5, 0.3, 0.9])


@pytest.mark.parametrize(
    ("judge", "run", "found"),
    [
        (fell, course([0.3, 0.9, 0.5], 0.1), False),  # never high
        (fell, course([0.3, 0.96, 0.81], 0.1), False),  # never low again
        (fell, course([0.3, 0.94, 0.95, 0.8, 0.3], 0.1), True),
        (fell, course([0.3, 0.95, 0.9, 0.81, 0.8], 0.1), True),
        (fell, course([0.3, 0.8, 0.95, 0.96, 0.98], 0.1), False),  # low before
        (resembles_fig12, curve([0.25, 0.5, 0.6]), True),
        (resembles_fig12, curve([0.25, 0.5, 0.9]), False),  # too good
        (resembles_fig12, curve([0.25, 0.3, 0.35]), False),  # too bad
        (resembles_fig12, curve([0.25, 0.9, 0.6]), False),  # no steady rise
        (resembles_fig12, curve([0.5, 0.55, 0.6]), False),  # hardly a rise
        (resembles_fig11, curve([0.3, 0.6], loss=[0.5, 0.3, 0.5, 0.3]), True),
        (resembles_fig11, curve([0.3, 0.6], loss=[0.5, 0.3, 0.3]), False),  # never rises
        (resembles_fig11, curve([0.3, 0.6], loss=[0.5, 0.3, 0.5]), False),  # never falls again
        (resembles_fig11, curve([0.3, 0.6], loss=[0.5, 0.49, 0.5, 0.3]), False),  # by too little
    ],
)
def test_what_falls_and_what_is_like_the_papers_figures(judge, run, found):
    """A fall leads from high to low."""
    assert judge(run) is found


@pytest.mark.parametrize(("sinks", "found"), [(0.12, True), (0.18, False)])
def test_a_loss_rises_for_good_if_it_sinks_by_less_than_half_of_it(sinks, found):
    """From 0.2 to 0.5."""
    loss = np.r_[0.3, 0.2, np.linspace(0.2, 0.5, 10), np.full(8, 0.5 - sinks)]
    assert statistics.loss_rises_for_good(course([0.5] * 20, loss)) is found


def test_two_values_have_an_interval_and_one_has_none():
    assert statistics.t_interval([0.5, 0.5]) == (0.5, 0.5)
    low, high = statistics.t_interval([0.5, 0.7])
    assert (low + high) / 2 == pytest.approx(0.6) and high > 0.7
    assert np.isnan(statistics.t_interval([0.5])).all()


def test_share_intervals_are_those_of_the_binomial_distribution():
    """At the ends of the interval, what was seen or more extreme has a probability of 2.5 %."""
    interval = statistics.share_interval
    assert interval(0, 300) == pytest.approx((0, 1 - 0.025 ** (1 / 300)))
    assert interval(300, 300) == pytest.approx((0.025 ** (1 / 300), 1))
    low, high = interval(4, 50)
    assert stats.binom.sf(3, 50, low) == pytest.approx(0.025)
    assert stats.binom.cdf(4, 50, high) == pytest.approx(0.025)


def test_pairs_make_the_interval_of_a_ratio_narrow():
    reference = np.array([1.0, 5.0, 2.0, 8.0])
    ratio, low, high = statistics.ratio_interval(1.3 * reference, reference)
    assert (ratio, low, high) == pytest.approx((1.3, 1.3, 1.3))
    assert np.isnan(statistics.ratio_interval(reference, -reference)).all()
    assert np.array_equal(statistics.mean_interval([0.7]), [0.7, np.nan, np.nan], equal_nan=True)
    assert np.isnan(statistics.ratio_interval(reference, np.array([-9.0, 9, 2, 0]))).all()
