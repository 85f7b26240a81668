"""The figures of the heaps."""

import pandas as pd
import pytest

from unload.reproduce.figures import heap
from unload.support.provenance import run_record, write_provenance

FIGURES = [heap.throughput_falls, heap.physics_agreement]


@pytest.fixture
def folder(tmp_path):
    """Made-up tables of three policies and of four picks."""
    rows = []
    for policy, weights in (("lowest", [1.0]), ("best rule", [0.0, 1.0]), ("learned", [0.0, 1.0])):
        for weight in weights:
            boxes = len(policy) / 5 - weight / 5
            row = {"condition": "as trained", "falls_weight": weight, "policy": policy}
            rows.append(row | {"boxes": boxes, "boxes_low": boxes - 0.2, "boxes_high": boxes + 0.3})
            rows[-1]["falls"] = 0.8 - weight / 2
    rows.append(rows[-1] | {"condition": "camera", "boxes": 9.0})
    rows.append(rows[0] | {"policy": "learned seed 0"})
    (tmp_path / "heap").mkdir()
    pd.DataFrame(rows).to_csv(tmp_path / "heap" / "table.csv", index=False)
    picks = [
        {"pick": pick, "physics": physics, "unloaded": pick + (physics == "near"), "falls": 0,
         "came": True, "moved": 0.7, "cpu_ms": 100.0}
        for pick in range(4) for physics in ("whole", "coarse", "near")
    ]  # fmt: skip
    pd.DataFrame(picks).to_csv(tmp_path / "heap" / "agreement.csv", index=False)
    write_provenance(tmp_path / "heap", "table", "made up", {"runs": 7}, True, run_record(1.0))
    return tmp_path


@pytest.mark.parametrize("draw", FIGURES)
def test_figure_is_saved_as_the_same_bytes(draw, folder, saved_twice):
    saved_twice(lambda: draw(folder))


@pytest.mark.parametrize("draw", FIGURES)
def test_missing_data_names_the_command_that_makes_it(draw, names_its_command):
    names_its_command(draw)


def test_rules_are_points_and_what_depends_on_the_weight_is_a_curve(folder):
    axes = heap.throughput_falls(folder).axes[0]
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels == ["best rule", "learned"]
    assert [text.get_text() for text in axes.texts] == ["lowest"]
    drawn = {tuple(line.get_ydata()) for line in axes.lines}
    assert (1.4, 1.2) in {tuple(round(y, 6) for y in ys) for ys in drawn}
    assert max(max(ys, default=0) for ys in drawn) < 9, "another condition"


def test_agreement_counts_what_is_the_same(folder):
    titles = [axes.get_title() for axes in heap.physics_agreement(folder).axes]
    assert titles[0].startswith("coarse: 100% the same, 100 ms")
    assert titles[1].startswith("near: 0% the same")
