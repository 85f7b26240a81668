"""Figs. 11 and 12."""

import json

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
