"""One policy from inside."""

import numpy as np
import pandas as pd
import pytest

from unload.load.colours import COLOURS
from unload.load.substacks import build_load
from unload.reproduce.figures import policy as figures


@pytest.fixture
def load():
    return build_load(np.full((2, 1, 4), 2))


def colours_of(picture):
    """RGB of all pixels that hold a colour of a box's upper face."""
    return {tuple(pixel) for pixel in np.asarray(picture).reshape(-1, 3)}


def test_stages_show_what_is_left_seen_and_picked(load):
    present = np.ones(len(load), bool)
    upper = int(load.positions[:, 2].argmax())
    seen = np.delete(np.arange(len(load)), [0, upper])
    gone = present.copy()
    gone[upper] = False
    figure = figures.unloading(
        load, [figures.Stage(present, seen, upper), figures.Stage(gone, seen, 1)]
    )
    first, second = [axes for axes in figure.axes if axes.images]
    assert first.get_title() == f"{len(load)} boxes left"
    assert second.get_title() == f"{len(load) - 1} boxes left"
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names == list(figures.PICKED.values())
    picked = tuple(np.rint(255 * np.array(COLOURS["liftable"])).astype(int).tolist())
    pictures = [colours_of(axes.images[0].get_array()) for axes in (first, second)]
    assert picked in pictures[0]
    assert len(pictures[0] ^ pictures[1]) > 0


def test_learning_shows_both_kinds_of_msr_and_the_loss():
    curve = pd.DataFrame(
        {"picks": [1000, 2000], "success_rate": [0.2, 0.9], "epsilon": [1, 0], "loss": [0.5, 0.1]}
    )
    left, right = figures.learning(curve, pd.Series({1000: 0.1, 2000: 1.0})).axes
    assert [line.get_ydata().tolist() for line in left.lines] == [[0.2, 0.9], [1, 0], [0.1, 1]]
    assert left.lines[2].get_xdata().tolist() == [1, 2]
    assert right.lines[0].get_ydata().tolist() == [0.5, 0.1]


def test_preferences_have_a_line_for_each_place():
    z = np.linspace(0, 2, 5)
    figure = figures.preferences(z, {"front": z, "rear": 2 * z}, z, np.add.outer(z, z))
    left = figure.axes[0]
    assert [line.get_ydata().tolist() for line in left.lines] == [z.tolist(), (2 * z).tolist()]
    assert [text.get_text() for text in left.get_legend().get_texts()] == ["front", "rear"]


def test_the_flattest_step_is_drawn():
    metres = np.array([[0.3, 0.2], [-0.1, 0.3], [0.0, 0.25]])
    left, right = figures.steps(metres, 0.4, np.array([[1, 20, 3], [0, -5, 8]])).axes
    dots, flattest, slope = left.lines
    assert np.array_equal(dots.get_xydata(), metres)
    assert flattest.get_ydata() == pytest.approx([0.4, 0, 0.4])  # 2/3 of 0.6 m
    assert slope.get_ydata() == pytest.approx([0.24, 0, 0.24])
    assert right.lines[1].get_xydata().tolist() == [[20, 3], [-5, 8]]


def test_noise_has_a_line_for_each_policy_and_mask():
    sigmas = [0.0, 0.05]
    columns = pd.MultiIndex.from_product([["highest", "recommended"], [True, False]])
    rates = pd.DataFrame([[1, 1, 1, 1], [0.8, 0.4, 0.7, 0.3]], sigmas, columns)
    (axes,) = figures.noise(rates, pd.Series([0, 0.01], sigmas)).axes
    labels = [line.get_label() for line in axes.lines]
    assert labels[:2] == ["highest", "highest, no mask"]
    assert axes.lines[3].get_ydata().tolist() == [1, 0.3]
    assert axes.lines[4].get_xdata().tolist() == [0, 5]


def test_figure_is_saved_as_the_same_bytes(saved_twice, load):
    stage = figures.Stage(np.ones(len(load), bool), np.arange(3), 1)
    saved_twice(lambda: figures.unloading(load, [stage, stage]))
