import pytest

from unload.reproduce.figures.values import value_traces, wrong_states
from unload.reproduce.interventions import SEEDS
from unload.reproduce.values import FRESH, FRESHER, read_values


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


def test_a_panel_for_each_fresh_run(saved_twice, names_its_command):
    table = read_values()
    fresh = table[(table["change"] == "nothing") & table["seed"].isin([*FRESH, *FRESHER])]
    panels = [axes for axes in wrong_states().axes if axes.lines]
    assert [axes.get_title() for axes in panels] == [f"seed {n}" for n in fresh["seed"].unique()]
    for axes, (_, run) in zip(panels, fresh.groupby("seed")):
        drawn = [line.get_ydata().tolist() for line in axes.lines]
        assert drawn == [run[name].tolist() for name in ("own_wrong", "start_wrong", "wrong")]
    saved_twice(wrong_states)
    names_its_command(wrong_states)
