import numpy as np
import pandas as pd
import pytest

from unload.reproduce.intervals import (
    bootstrap_interval,
    mean_interval,
    ratio_interval,
    share_interval,
    with_intervals,
)


def test_the_interval_covers_the_true_mean_about_as_often_as_it_says(rng):
    covered = 0
    for _ in range(300):
        low, high = bootstrap_interval(rng.normal(3, 1, 40))
        covered += low < 3 < high
    assert 0.90 < covered / 300 < 0.98


def test_one_value_and_equal_values_have_no_width():
    assert bootstrap_interval([0.25]) == (0.25, 0.25)
    assert bootstrap_interval([0.5, 0.5, 0.5]) == (0.5, 0.5)


def test_a_higher_level_is_wider_and_the_seed_decides(rng):
    values = rng.normal(size=20)
    narrow, wide = bootstrap_interval(values, 0.5), bootstrap_interval(values, 0.99)
    assert wide[0] < narrow[0] < narrow[1] < wide[1]
    assert bootstrap_interval(values, seed=1) == bootstrap_interval(values, seed=1)
    assert bootstrap_interval(values, seed=1) != bootstrap_interval(values, seed=2)


@pytest.mark.parametrize(
    ("values", "level", "name"),
    [([], 0.95, "values"), ([np.nan], 0.95, "values"), ([1], 2, "level")],
)
def test_bad_values_are_refused_by_name(values, level, name):
    with pytest.raises(ValueError, match=name):
        bootstrap_interval(values, level)


def test_groups_keep_their_order_and_their_means():
    table = pd.DataFrame(
        {"cell": ["b", "b", "a", "a"], "mask": [True] * 4, "msr": [0.0, 1.0, 0.5, 0.5]}
    )
    rows = with_intervals(table, ["cell", "mask"], ["msr"])
    assert rows["cell"].tolist() == ["b", "a"]
    assert rows["runs"].tolist() == [2, 2]
    assert rows["msr"].tolist() == [0.5, 0.5]
    assert rows[["msr_low", "msr_high"]].to_numpy().tolist() == [[0.0, 1.0], [0.5, 0.5]]


def test_a_missing_column_is_refused_by_name():
    with pytest.raises(ValueError, match="msr"):
        with_intervals(pd.DataFrame({"cell": [1]}), ["cell"], ["msr"])


def test_share_intervals_are_those_of_the_binomial_distribution(rng):
    """At the ends of the interval, what was seen or more extreme has a probability of 2.5 %."""
    assert share_interval(0, 300) == pytest.approx((0, 1 - 0.025 ** (1 / 300)))
    assert share_interval(300, 300) == pytest.approx((0.025 ** (1 / 300), 1))
    low, high = share_interval(4, 50)
    drawn = rng.binomial(50, [[low], [high]], (2, 200_000))
    assert (drawn[0] >= 4).mean() == pytest.approx(0.025, abs=0.003)
    assert (drawn[1] <= 4).mean() == pytest.approx(0.025, abs=0.003)
    narrow = share_interval(4, 50, 0.5)
    assert low < narrow[0] < 4 / 50 < narrow[1] < high


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((3, 2), "count is 3"),
        ((0, 0), "total is 0"),
        ((-1, 2), "count is -1"),
        ((1, 2, 1), "level"),
    ],
)
def test_impossible_shares_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        share_interval(*arguments)


def test_pairs_make_the_interval_narrow():
    reference = np.array([1.0, 5.0, 2.0, 8.0])
    ratio, low, high = ratio_interval(1.3 * reference, reference)
    assert (ratio, low, high) == pytest.approx((1.3, 1.3, 1.3))
    assert np.isnan(ratio_interval(reference, -reference)).all()
    assert np.isnan(ratio_interval(reference, np.array([-9.0, 9, 2, 0]))).all()


def test_bca_intervals_of_skewed_values_lean_to_the_long_side():
    """What distinguishes them from percentile ones, and their agreement with scipy's own."""
    values = np.array([1.0, 1, 1, 1, 1, 2, 2, 3, 9, 20])
    mean, low, high = mean_interval(values)
    percentile = bootstrap_interval(values)
    assert mean == 4.1 and low < mean < high
    assert low > percentile[0] and high > percentile[1]
    assert mean_interval([2.0, 2.0]) == (2.0, 2.0, 2.0)
    assert mean_interval(values) == (mean, low, high)
