"""Figures of the policies."""

import pytest

from studies.policies import comparison, figures, robustness


def test_every_condition_has_its_panel():
    assert set(figures.CONDITIONS) == {*comparison.CONDITIONS, *figures.FULL.values()}
    assert set(figures.FULL) == {after_pick for _, after_pick in robustness.PLAYED}
    shown = [axes.get_title("left") for axes in figures.comparison_msr().axes]
    assert shown == list(figures.CONDITIONS)


def test_dots_are_the_means_over_the_containers():
    panels = {axes.get_title("left"): axes for axes in figures.comparison_msr().axes}
    table = figures.read_comparison()
    for condition, axes in panels.items():
        rows = table[table["condition"] == condition]
        means = [
            group["success_rate"].mean()
            for player in figures.ROWS
            if len(group := rows[(rows["policy"] == player[0]) & (rows["mask"] == player[1])])
        ]
        assert [line.get_xdata()[0] for line in axes.lines[1::2]] == pytest.approx(means)
        assert len(axes.texts) == len(figures.ROWS) - len(means)
