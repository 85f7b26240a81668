import numpy as np
import pandas as pd
import pytest

from unload.reproduce import resampling

TWO_ENDINGS = [0.37, 0.40, 0.90, 0.95]


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def test_intervals_cover_as_promised_where_values_are_normal_and_many(rng):
    values = rng.normal(0.5, 0.1, 2000)
    table = resampling.coverage(values, [20], rng, 1000).set_index("interval")
    assert table.index.tolist() == ["t", "percentile", "BCa"]
    assert table["covered"].between(0.9, 0.975).all()
    assert table["width"].between(0.05, 0.12).all()


def test_a_rare_ending_is_missed_by_every_interval(rng):
    table = resampling.coverage([0.4] * 9 + [0.9], [5], rng, 1000)
    assert (table["covered"] < 0.5).all()  # five runs are all of one ending in 59 % of cases
    equal = resampling.coverage([0.4, 0.4], [5], rng, 10).set_index("interval")["covered"]
    assert equal.tolist() == [1, 1, 0]  # equal values have no BCa interval


def test_peeking_raises_false_alarms_and_one_test_does_not(rng):
    table = resampling.false_alarms(rng.normal(size=500), 4, 14, rng)
    assert table["runs"].tolist() == list(range(4, 15))
    assert table["planned"].between(0.02, 0.08).all()
    assert (np.diff(table["peeking"]) >= 0).all()
    assert table["peeking"].iloc[0] == table["planned"].iloc[0]
    assert table["peeking"].iloc[-1] > 0.1
    strict = resampling.false_alarms(TWO_ENDINGS, 4, 6, rng, level=0.0)
    assert not strict[["planned", "peeking"]].any(axis=None)


@pytest.mark.parametrize("call", ["coverage", "false_alarms"])
def test_same_seed_same_table(call):
    sizes = ([2, 4],) if call == "coverage" else (3, 5)
    tables = [
        getattr(resampling, call)(TWO_ENDINGS, *sizes, np.random.default_rng(1), 50)
        for _ in range(2)
    ]
    pd.testing.assert_frame_equal(*tables)


def test_bad_input_is_refused(rng):
    with pytest.raises(ValueError, match="values is empty; expected at least one number"):
        resampling.coverage([], [4], rng)
    with pytest.raises(ValueError, match="counts is 1; expected .* >= 2"):
        resampling.coverage(TWO_ENDINGS, [4, 1], rng)
    with pytest.raises(TypeError, match="rng is 0; expected a numpy.random.Generator"):
        resampling.coverage(TWO_ENDINGS, [4], 0)
    with pytest.raises(ValueError, match="last is 3; expected"):
        resampling.false_alarms(TWO_ENDINGS, 4, 3, rng)
    with pytest.raises(ValueError, match="first is 1; expected"):
        resampling.false_alarms(TWO_ENDINGS, 1, 3, rng)
    with pytest.raises(ValueError, match="level is 2"):
        resampling.false_alarms(TWO_ENDINGS, 3, 4, rng, level=2)
