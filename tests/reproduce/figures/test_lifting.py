"""The figures of lifts. What ``agreement_scatter`` shows is tested with its data."""

import numpy as np
import pytest

from unload import task
from unload.load.colours import COLOURS
from unload.reproduce.figures.lifting import distance_curves, lift_sequences


def test_bad_lift_sequences_are_refused():
    sizes, poses = np.ones((2, 2)), np.zeros((1, 2, 3))
    for lifts, times, error, message in (
        ({}, [0.0], ValueError, "lifts has 0 and times 1 entries; expected at least one"),
        ({"a": (sizes, poses)}, [], ValueError, "lifts has 1 and times 0 entries"),
        ([1], [0.0], TypeError, r"lifts is \[1\]; expected a dict"),
        ({"a": (sizes, poses)}, [0.0, 0.1], ValueError, "poses of 'a' has shape"),
    ):
        with pytest.raises(error, match=message):
            lift_sequences(lifts, times)
    assert len(lift_sequences({"a": (sizes, poses)}, [0.0]).axes) == 1


def test_colour_of_the_chosen_box_says_whether_it_was_lifted():
    sizes, poses = np.ones((2, 2)), np.zeros((2, 2, 3))
    lifted = poses.copy()
    lifted[1, 0, 1] = task.LIFT_THRESHOLD
    figure = lift_sequences({"stays": (sizes, poses), "moves": (sizes, lifted)}, [0.0, 0.3])
    colours = [axes.patches[0].get_facecolor()[:3] for axes in figure.axes]
    blocked, liftable = COLOURS["blocked"], COLOURS["liftable"]
    assert np.allclose(colours, [blocked, blocked, liftable, liftable])
    texts = [text.get_text() for text in figure.legends[0].texts]
    assert texts == ["chosen box, blocked", "chosen box, liftable", "on top of it", "cannot move"]


def test_distance_curves_show_formula_and_measurement():
    x = np.array([1.0, 2.0])
    curves = {"one box": (x, x / 10, x / 9), "two boxes": (x, x / 20, x / 21)}
    figure = distance_curves({"force (N)": curves, "mass (kg)": {}}, {"force (N)": 20})
    left, right = figure.axes
    shown = [line.get_xydata().tolist() for line in left.lines[:4]]
    expected = [np.column_stack([x, y]).tolist() for _, *ys in curves.values() for y in ys]
    assert shown == expected
    assert len(left.lines) == 4 + 2 and len(right.lines) == 1  # threshold, and the mark
    with pytest.raises(ValueError, match="panels has no mass"):
        distance_curves({"force (N)": curves}, {"mass": 1})
    with pytest.raises(ValueError, match="panels is empty"):
        distance_curves({}, {})
