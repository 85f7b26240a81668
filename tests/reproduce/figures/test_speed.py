"""The figures of the benchmarks; ``tests/test_benchmarks.py`` holds what they are drawn from."""

import numpy as np
import pandas as pd
import pytest

from unload import stack_load
from unload.load.colours import COLOURS
from unload.physics.situation import Surroundings
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


def test_situation_is_drawn_where_its_boxes_stand():
    load = stack_load(np.random.default_rng(0))
    surroundings = Surroundings(load, np.ones(len(load), bool))
    item = next(item for item in range(len(load)) if len(surroundings.on_top(item)) == 2)
    situation = surroundings.situation(item)
    figure = speed.situation_in_its_wall(load, item, situation, 0.01)
    (axes,) = figure.axes
    wall = np.flatnonzero(load.walls == load.walls[item])
    background, boxes = axes.patches[: len(wall)], axes.patches[len(wall) :]
    assert len(boxes) == len(situation.boxes)
    assert all(box.get_facecolor()[:3] == COLOURS["unseen"] for box in background)
    assert boxes[0].get_facecolor()[:3] == COLOURS["blocked"]
    assert boxes[1].get_facecolor()[:3] == COLOURS["on top of it"]
    lifted = speed.situation_in_its_wall(load, item, situation, 0.2).axes[0].patches[len(wall)]
    assert lifted.get_facecolor()[:3] == COLOURS["liftable"]
    corners = {tuple(np.round(box.get_xy(), 3)) for box in background}
    assert tuple(np.round(boxes[0].get_xy(), 3)) in corners
    assert sum(box.get_facecolor() == boxes[1].get_facecolor() for box in boxes) == 2
    assert str(len(situation.boxes)) in axes.get_title()


def test_ways_are_compared_with_the_first():
    (axes,) = speed.cost_of_ways(pd.Series({"plain": 80.0, "fast": 20.0})).axes
    assert [bar.get_width() for bar in axes.patches] == [80, 20]
    assert [text.get_text().strip() for text in axes.texts] == ["80 µs, 1 ×", "20 µs, 4 ×"]
