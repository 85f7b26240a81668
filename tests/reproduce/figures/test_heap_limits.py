"""The figure of what limits a learned policy."""

import numpy as np
import pandas as pd
import pytest

from unload.reproduce.figures.heap_limits import limits, repeatability
from unload.support.provenance import run_record, write_provenance


@pytest.fixture
def disturbed() -> pd.DataFrame:
    """Picks that a small distance leaves as they are and a large one changes."""
    boxes = np.array([1, 2, 3, 4])
    parts = [
        pd.DataFrame({"pick": range(4), "distance": distance, "boxes": values, "falls": 0})
        for distance, values in ((0.0, boxes), (0.001, boxes), (0.005, boxes[[1, 0, 2, 3]]))
    ]
    return pd.concat(parts)


@pytest.fixture
def folder(tmp_path, disturbed):
    place = tmp_path / "heap"
    place.mkdir()
    disturbed.to_csv(place / "disturbed.csv", index=False)
    table = {
        "variant": ["learned"] * 4 + ["own row"],
        "heaps": [7, 7, 14, 14, 14],
        "seed": [0, 1, 0, 1, 0],
        "correlation": [0.6, 0.62, 0.7, 0.7, 0.5],
    }
    pd.DataFrame(table).to_csv(place / "limits.csv", index=False)
    write_provenance(place, "limits", "made up", {"runs": 7}, True, run_record(1.0))
    return tmp_path


def test_repeatability_compares_with_the_pick_that_was_not_disturbed(disturbed):
    assert repeatability(disturbed).to_dict() == pytest.approx({0.001: 1.0, 0.005: 0.8})


def test_the_figure_has_the_means_and_a_line_for_each_distance(folder):
    axes = limits(folder).axes[0]
    assert axes.lines[1].get_ydata() == pytest.approx([0.61, 0.7])
    assert [line.get_ydata()[0] for line in axes.lines[2:]] == pytest.approx([0.5, 1.0, 0.8**0.5])
    assert [text.get_text() for text in axes.texts] == ["own row"]


def test_figure_is_saved_as_the_same_bytes(folder, saved_twice):
    saved_twice(lambda: limits(folder))


def test_missing_data_names_the_command_that_makes_it(names_its_command):
    names_its_command(limits)
