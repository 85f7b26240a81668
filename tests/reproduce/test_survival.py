import numpy as np
import pytest

import unload
from unload.reproduce import survival


def test_successes_before_the_first_mistake():
    before = survival.before_first_mistake(unload.policies.highest, 2, 0)
    assert before.tolist() == [500, 500]


def test_a_policy_that_changes_its_mind_is_refused():
    with pytest.raises(ValueError, match="several mistakes"):
        survival.before_first_mistake(unload.policies.random, 2, 0)


def test_survival_falls_at_each_mistake():
    share = survival.surviving([0, 2, 500, 500])
    assert share[[0, 1, 2, 3, 500]].tolist() == [1, 0.75, 0.75, 0.5, 0.5]


def test_a_constant_chance_is_found_again():
    rng = np.random.default_rng(0)
    before = np.minimum(rng.geometric(0.01, 20_000) - 1, 500)
    assert survival.constant_chance(before) == pytest.approx(0.01, rel=0.03)
    found = survival.early_and_late(before)
    assert found["early"] == pytest.approx(0.01, rel=0.05)
    assert found["late"] == pytest.approx(0.01, rel=0.05)
    assert found["p"] > 0.01


def test_a_rising_chance_is_told_from_a_constant_one():
    found = survival.early_and_late([50, *[150] * 20])
    assert found["early"] == pytest.approx(1 / (20 * 100 + 51))
    assert found["late"] == pytest.approx(20 / (20 * 51))
    assert found["p"] < 1e-6
    assert np.isnan(survival.early_and_late([3, 4])["late"])
