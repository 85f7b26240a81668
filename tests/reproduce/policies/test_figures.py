"""Figures of the policies, and those of the speeds."""

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from unload import stack_load
from unload.load.view import COLOURS
from unload.physics.situation import Surroundings
from unload.reproduce.policies import comparison, figures, inside, robustness, speed

matplotlib.use("Agg")


@pytest.fixture(autouse=True)
def close_figures():
    yield
    plt.close("all")


def test_every_condition_has_its_panel():
    assert set(figures.CONDITIONS) == {*comparison.CONDITIONS, *figures.FULL.values()}
    assert set(figures.FULL) == set(robustness.PLAYED)
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


@pytest.mark.parametrize("draw", [figures.comparison_means, figures.comparison_msr])
def test_missing_data_name_their_command(tmp_path, draw):
    with pytest.raises(FileNotFoundError, match="python -m unload.reproduce policies makes it"):
        draw(tmp_path)


def test_learning_preferences_and_noise_are_drawn_as_given():
    curve = pd.DataFrame({"picks": [1000, 2000], "success_rate": 0.5, "epsilon": 1.0, "loss": 0.1})
    left, _ = inside.learning(curve, pd.Series([0.1, 1.0], [1500, 2000])).axes
    assert left.lines[2].get_xydata().tolist() == [[1.5, 0.1], [2, 1]]
    z, y = np.linspace(0, 2, 5), np.linspace(0, 1, 3)
    left, *_ = inside.preferences(z, {"front": z, "rear": 2 * z}, y, np.add.outer(z, y)).axes
    assert [text.get_text() for text in left.get_legend().get_texts()] == ["front", "rear"]
    sigmas, columns = [0.0, 0.05], pd.MultiIndex.from_product([["highest"], [True, False]])
    rates = pd.DataFrame([[1, 1], [0.8, 0.4]], sigmas, columns)
    (axes,) = inside.noise(rates, pd.Series([0, 0.01], sigmas)).axes
    assert [line.get_label() for line in axes.lines][:2] == ["highest", "highest, no mask"]
    assert axes.lines[2].get_xdata().tolist() == [0, 5]


def test_the_flattest_step_is_drawn():
    metres = np.array([[0.3, 0.2], [-0.1, 0.3], [0.0, 0.25]])
    left, right = inside.steps(metres, 0.4, np.array([[1, 20, 3], [0, -5, 8]])).axes
    dots, flattest, slope = left.lines
    assert np.array_equal(dots.get_xydata(), metres)
    assert flattest.get_ydata() == pytest.approx([0.4, 0, 0.4])  # 2/3 of 0.6 m
    assert slope.get_ydata() == pytest.approx([0.24, 0, 0.24])
    assert right.lines[1].get_xydata().tolist() == [[20, 3], [-5, 8]]


def test_bars_are_the_measured_ratios():
    table = speed.read_speeds()
    bars = [bar.get_width() for axes in speed.speed_ratios().axes for bar in axes.patches]
    grouped = [ratio for _, group in table.groupby("what", sort=False) for ratio in group["ratio"]]
    assert np.allclose(bars, grouped)


def test_ways_are_compared_with_the_first():
    (axes,) = speed.cost_of_ways(pd.Series({"plain": 80.0, "fast": 20.0})).axes
    assert [text.get_text().strip() for text in axes.texts] == ["80 µs, 1 ×", "20 µs, 4 ×"]


@pytest.mark.parametrize(
    ("value", "text"), [(1234567.0, "1,230,000"), (0.98765, "0.988"), (12.0, "12")]
)
def test_three_digits(value, text):
    assert speed.three_digits(value) == text


def test_a_situation_is_drawn_where_its_boxes_stand():
    load = stack_load(np.random.default_rng(0))
    surroundings = Surroundings(load, np.ones(len(load), bool))
    item = next(item for item in range(len(load)) if len(surroundings.on_top(item)) == 2)
    situation = surroundings.situation(item)
    (axes,) = speed.situation_in_its_wall(load, item, situation, 0.01).axes
    wall = np.flatnonzero(load.walls == load.walls[item])
    background, boxes = axes.patches[: len(wall)], axes.patches[len(wall) :]
    assert len(boxes) == len(situation.boxes)
    assert boxes[0].get_facecolor()[:3] == COLOURS["blocked"]
    assert boxes[1].get_facecolor()[:3] == COLOURS["on top of it"]
    lifted = speed.situation_in_its_wall(load, item, situation, 0.2).axes[0].patches[len(wall)]
    assert lifted.get_facecolor()[:3] == COLOURS["liftable"]
    corners = {tuple(np.round(box.get_xy(), 3)) for box in background}
    assert tuple(np.round(boxes[0].get_xy(), 3)) in corners


@pytest.mark.parametrize(
    ("content", "error", "message"),
    [
        (None, FileNotFoundError, "is missing; python benchmarks/run.py makes it"),
        ("a,b\n1,2\n", ValueError, "expected what, how, value, unit, ratio"),
    ],
)
def test_bad_tables_of_speeds_are_refused(tmp_path, content, error, message):
    if content is not None:
        (tmp_path / "speeds.csv").write_text(content)
    with pytest.raises(error, match=message):
        speed.speed_ratios(tmp_path)
