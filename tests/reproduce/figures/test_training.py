"""Figs. 11 and 12."""

import json

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from unload.reproduce.figures import training
from unload.support import files

FIGURES = [training.fig11_loss, training.fig12_reward]


@pytest.mark.parametrize("draw", FIGURES)
def test_figure_is_saved_as_the_same_bytes(draw, saved_twice):
    saved_twice(draw)


@pytest.mark.parametrize("draw", FIGURES)
def test_missing_data_names_the_command_that_makes_it(draw, names_its_command):
    names_its_command(draw)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("Step,Value\n1,2\n", r"has columns \['Step', 'Value'\]; expected \['Wall time', "),
        ("Wall time,Step,Value\n", "has no rows; expected at least one"),
        ("Wall time,Step,Value\n1,2,\n", "holds nan"),
    ],
)
def test_bad_training_curves_are_refused(tmp_path, content, message):
    (tmp_path / "loss_function_agent.csv").write_text(content)
    with pytest.raises(ValueError, match=f"loss_function_agent.csv {message}"):
        training.read_curve(tmp_path, "loss_function_agent")


@pytest.mark.parametrize("reduced", [True, False])
def test_a_reduced_run_says_so(tmp_path, reduced):
    for name in ("loss_function_agent.csv", "training.provenance.json"):
        (tmp_path / name).write_text((files.DATA / name).read_text())
    path = tmp_path / "training.provenance.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"reduced": reduced}))
    note = training.fig11_loss(tmp_path).get_supxlabel()
    assert ("reduced run" in note) == reduced


def test_each_seed_has_a_colour_and_a_label():
    lines = training.fig12_reward().axes[0].lines
    assert [line.get_label() for line in lines] == [f"seed {seed}" for seed in range(4)]
    assert len({line.get_color() for line in lines}) == 4


def test_a_learning_curve_is_drawn_over_whole_episodes():
    picks = np.arange(1, 101) * 640
    curve = pd.DataFrame({"picks": picks, "success_rate": np.tile([0.2, 0.6], 50)})
    figure, axes = plt.subplots()
    training.draw_learning_curve(axes, curve.assign(wall_time=0, epsilon=0), "run")
    points, episodes = axes.lines
    assert len(points.get_ydata()) == 100
    assert episodes.get_xdata().tolist() == [16_000, 48_000]
    assert episodes.get_ydata() == pytest.approx([0.4, 0.4])


def test_the_msr_by_pick_is_drawn_as_means():
    figure, axes = plt.subplots()
    training.draw_by_pick(axes, {"all": np.ones(500), "none": np.zeros(500)})
    assert [line.get_label() for line in axes.lines] == ["all", "none"]
    assert [set(line.get_ydata()) for line in axes.lines] == [{1}, {0}]


def test_values_are_drawn_by_what_can_be_lifted():
    figure, axes = plt.subplots()
    training.draw_values(axes, np.arange(3) / 3, np.zeros(3), np.array([True, False, True]))
    blocked, liftable = axes.collections
    assert (blocked.get_label(), liftable.get_label()) == ("blocked", "liftable")
    assert (len(blocked.get_offsets()), len(liftable.get_offsets())) == (1, 2)
