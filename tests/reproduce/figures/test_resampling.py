"""The figures of the practice of research; `test_resampling` one folder up holds their numbers."""

import numpy as np
import pandas as pd
import pytest

from unload.reproduce.figures import resampling as figures


def dots(axes, marker="o"):
    """x and y of all points with a marker, in the order in which they were drawn."""
    lines = [line for line in axes.lines if line.get_marker() == marker]
    return np.concatenate([np.transpose([line.get_xdata(), line.get_ydata()]) for line in lines])


@pytest.fixture
def wrong():
    return pd.DataFrame({"misses": [1.0, 0.5], "differs": [0.5, 0.6]}, index=[1, 2])


def test_each_window_is_a_dot_of_its_run():
    index = pd.MultiIndex.from_tuples([("b = 256", 0), ("b = 256", 3)])
    table = pd.DataFrame({"last 1 %": [0.9, 0.3], "last tenth": [0.7, 0.4]}, index=index)
    (axes,) = figures.ends_by_window(table).axes
    assert dots(axes).tolist() == [[0.9, 0], [0.3, 1]]
    assert dots(axes, "s").tolist() == [[0.7, 0], [0.4, 1]]
    assert [text.get_text() for text in axes.get_yticklabels()] == [
        "b = 256, seed 0", "b = 256, seed 3"
    ]  # fmt: skip


def test_each_group_of_runs_has_a_panel():
    picks = np.arange(100_000, 2_000_001, 100_000)
    curve = pd.DataFrame({"picks": picks, "success_rate": 0.5, "loss": 0.2})
    panels = figures.run_curves({"with": [curve], "without": [curve, curve]}).axes
    assert [axes.get_title() for axes in panels] == ["with, runs: 1", "without, runs: 2"]
    assert panels[0].lines[0].get_xdata().tolist() == [0.25, 0.75, 1.25, 1.75]
    assert (panels[1].lines[1].get_ydata() == 0.5).all()


def test_shares_of_wrong_conclusions_are_drawn(wrong):
    means = {1: np.array([0.4, 0.9]), 2: np.array([0.4, 0.65, 0.65, 0.9])}
    left, right = figures.means_of_few(means, wrong).axes
    assert [text.get_text() for text in left.get_yticklabels()] == ["1", "2"]
    tallest = max(bar.get_height() for bar in left.patches)
    assert tallest == pytest.approx(0.8)
    assert dots(right).tolist() == [[1, 1.0], [2, 0.5]]
    assert dots(right, "s").tolist() == [[1, 0.5], [2, 0.6]]


def test_coverage_has_a_line_for_each_interval():
    table = pd.DataFrame(
        {"runs": [4, 4, 8, 8], "interval": ["t", "BCa"] * 2, "covered": [0.8, 0.7, 0.95, 0.9]}
    )
    first, second = figures.coverage_by_runs({"one": table, "other": table}).axes
    assert [first.get_title(), second.get_title()] == ["one", "other"]
    assert dots(first).tolist() == [[4, 0.8], [8, 0.95]]
    assert dots(second, "s").tolist() == [[4, 0.7], [8, 0.9]]


def test_alarms_are_drawn_with_and_without_peeking():
    table = pd.DataFrame({"runs": [3, 4], "planned": [0.05, 0.04], "peeking": [0.05, 0.08]})
    (axes,) = figures.alarms_by_runs(table).axes
    assert dots(axes).tolist() == [[3, 0.05], [4, 0.04]]
    assert dots(axes, "s").tolist() == [[3, 0.05], [4, 0.08]]


def test_figure_is_saved_as_the_same_bytes(saved_twice, wrong):
    saved_twice(lambda: figures.means_of_few({1: np.array([0.4, 0.9])}, wrong))
