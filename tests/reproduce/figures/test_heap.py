"""The figures of the heaps."""

import numpy as np
import pandas as pd
import pytest

from unload.reproduce.figures import heap
from unload.reproduce.heap_table import compared
from unload.support.provenance import run_record, write_provenance

FIGURES = [
    heap.policies,
    heap.ablations,
    heap.conditions,
    heap.throughput_falls,
    heap.lifts_and_picks,
    heap.camera_errors,
    heap.physics_agreement,
]
BOXES = {"lowest": 1.2, "highest": 1.0, "best rule": 1.8, "learned": 2.4}


@pytest.fixture
def folder(tmp_path):
    """Made-up tables: four policies and a seed on three heaps, two λ, two conditions."""
    rng = np.random.default_rng(0)
    cells = [("as trained", 1.0, name) for name in (*BOXES, "seed 0", "pooled", "own row")]
    cells += [("as trained", 0.0, name) for name in ("best rule", "learned")]
    camera = "best rule", "rule chosen with variation", "highest", "learned"
    cells += [("camera", 1.0, name) for name in camera]
    rows = []
    for condition, weight, name in cells:
        boxes = BOXES.get(name, 2.2) - weight / 5 + 7 * (condition == "camera")
        for number in range(3):
            row = {"condition": condition, "falls_weight": weight, "policy": name, "heap": number}
            row |= {"boxes": boxes + rng.uniform(-0.2, 0.2), "falls": 0.8 - weight / 2}
            rows.append(row | {"net": row["boxes"] - weight * row["falls"]})
    folder = tmp_path / "heap"
    folder.mkdir()
    compared(pd.DataFrame(rows)).to_csv(folder / "table.csv", index=False)
    picks = [
        {"pick": pick, "physics": physics, "unloaded": pick + (physics == "near"), "falls": 0,
         "came": True, "moved": 0.7, "cpu_ms": 100.0}
        for pick in range(4) for physics in ("whole", "coarse", "near")
    ]  # fmt: skip
    pd.DataFrame(picks).to_csv(folder / "agreement.csv", index=False)
    lifts = [
        {"policy": name, "heap": n, "lifts": 15, "falls": 0, "success_rate": rate - n / 10}
        for name, rate in (("lowest", 0.4), ("highest", 1.0)) for n in range(3)
    ]  # fmt: skip
    pd.DataFrame(lifts).to_csv(folder / "lifts.csv", index=False)
    pixels = np.arange(4, 104)
    camera = {"pixels": pixels, "centre_error": 1 / pixels, "extent_error": -1 / pixels}
    pd.DataFrame(camera).to_csv(folder / "camera.csv", index=False)
    for name in ("table", "lifts"):
        write_provenance(folder, name, "made up", {"runs": 7}, True, run_record(1.0))
    return tmp_path


@pytest.mark.parametrize("draw", FIGURES)
def test_figure_is_saved_as_the_same_bytes(draw, folder, saved_twice):
    saved_twice(lambda: draw(folder))


@pytest.mark.parametrize("draw", FIGURES)
def test_missing_data_names_the_command_that_makes_it(draw, names_its_command):
    names_its_command(draw)


def test_leads_are_differences_on_the_same_heaps(folder):
    table = heap.read_heap_table(folder)
    net = heap.at_shown_weight(table, BOXES | {heap.VARIED_RULE: 0}, "camera")["net"]
    leads = heap.leads(folder).loc["camera"]
    for name in ("best rule", heap.VARIED_RULE):
        value, ends = leads[f"more than the {name}"].split(" ", 1)
        low, high = map(float, ends.strip("()").split(" to "))
        assert float(value) == pytest.approx(net["learned"] - net[name], abs=0.006)
        assert low <= float(value) <= high


def labels(axes) -> list[str]:
    return [text.get_text() for text in axes.get_yticklabels()]


def test_policies_are_rows_with_intervals_as_trained(folder):
    table = heap.read_heap_table(folder).set_index(["condition", "falls_weight", "policy"])
    axes = heap.policies(folder).axes
    assert labels(axes[0]) == ["highest", "lowest", "best rule", "learned"]
    learned = table.loc[("as trained", 1.0, "learned")]
    assert axes[2].lines[-1].get_xdata() == pytest.approx([learned["net"]])
    interval = axes[2].lines[-2].get_xdata()
    assert list(interval) == pytest.approx([learned["net_low"], learned["net_high"]])


def test_ablations_have_variants_and_seeds(folder):
    axes = heap.ablations(folder).axes
    assert labels(axes[0]) == ["learned", "pooled", "own row", "seed 0"]
    assert labels(axes[1]) == ["pooled − sums only", "own row − pooled", "seed 0 − learned"]
    table = heap.at_shown_weight(heap.read_heap_table(folder), ["pooled", "own row"])
    assert axes[1].lines[3].get_xdata() == pytest.approx([table["net"].diff().iloc[1]])


def test_conditions_show_few_policies(folder):
    axes = heap.conditions(folder).axes[0]
    assert labels(axes) == ["camera", "as trained"]
    names = [text.get_text() for text in axes.get_legend().get_texts()]
    assert names == ["best rule", "rule chosen with variation", "learned"]
    dots = [line.get_xdata()[0] for line in axes.lines if len(line.get_xdata()) == 1]
    assert len(dots) == 5 and sum(value > 7 for value in dots) == 3, "camera"


def test_rules_are_points_and_what_depends_on_the_weight_is_a_curve(folder):
    axes = heap.throughput_falls(folder).axes[0]
    names = [text.get_text() for text in axes.get_legend().get_texts()]
    assert names == ["best rule", "learned"]
    assert {text.get_text() for text in axes.texts} == {"lowest", "highest", "λ = 0", "λ = 1"}
    assert {len(line.get_ydata()) for line in axes.lines} >= {1, 2}
    assert max(max(line.get_ydata(), default=0) for line in axes.lines) < 7, "another condition"


def test_lifts_stand_beside_picks_of_the_same_rules(folder):
    left, right = heap.lifts_and_picks(folder).axes
    assert labels(left) == ["highest", "lowest"], "the best first"
    assert left.lines[1].get_xdata() == pytest.approx([0.9])
    assert len(right.lines) == 4


def test_predictions_stand_against_what_came():
    expected = pd.DataFrame({"boxes": [1.5, 0.5], "falls": [0.25, 2.0]})
    found = pd.DataFrame({"boxes": [2, 1], "falls": [0, 3]})
    boxes, falls = heap.predictions(expected, found).axes
    assert boxes.collections[0].get_offsets().tolist() == [[1.5, 2], [0.5, 1]]
    assert falls.collections[0].get_offsets().tolist() == [[0.25, 0], [2.0, 3]]


def test_camera_errors_have_a_median_over_pixels(folder):
    left, _ = heap.camera_errors(folder).axes
    (line,) = left.lines
    assert len(line.get_xdata()) == 8 and (np.diff(line.get_ydata()) < 0).all()


def test_agreement_counts_what_is_the_same(folder):
    titles = [axes.get_title() for axes in heap.physics_agreement(folder).axes]
    assert titles[0].startswith("coarse: 100% the same, 100 ms")
    assert titles[1].startswith("near: 0% the same")
