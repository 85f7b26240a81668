"""The figures of the benchmarks; ``tests/test_benchmarks.py`` holds what they are drawn from."""

import numpy as np
import pytest

from unload.reproduce.figures import speed


def test_bars_are_the_measured_ratios():
    table = speed.read_table("speeds")
    bars = [bar.get_width() for axes in speed.speed_ratios().axes for bar in axes.patches]
    grouped = [ratio for _, group in table.groupby("what", sort=False) for ratio in group["ratio"]]
    assert np.allclose(bars, grouped)


@pytest.mark.parametrize(
    ("value", "text"), [(1234567.0, "1,230,000"), (0.98765, "0.988"), (12.0, "12")]
)
def test_three_digits(value, text):
    assert speed.three_digits(value) == text
