import pytest

from unload.reproduce.figures.values import value_traces
from unload.reproduce.values import SEEDS


def test_a_line_for_each_run(saved_twice, names_its_command):
    changes = {"nothing": "control", "failures_kept": "kept"}
    panels = value_traces(changes).axes
    assert [len(axes.lines) for axes in panels] == 4 * [len(SEEDS)]
    assert [axes.get_title() for axes in panels] == ["control", "kept", "", ""]
    saved_twice(lambda: value_traces(changes))
    names_its_command(lambda folder: value_traces(changes, folder))


def test_bad_changes_are_refused():
    with pytest.raises(ValueError, match="changes is 'memory_23'"):
        value_traces({"memory_23": ""})
    with pytest.raises(ValueError, match="changes is empty"):
        value_traces({})
