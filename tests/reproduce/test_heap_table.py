"""Policies compared on heaps, at reduced size."""

from functools import partial

import numpy as np
import pandas as pd
import pytest
import torch

from unload.heap.env import HeapEnv
from unload.heap.learning import save_network
from unload.heap.network import HeapNetwork
from unload.heap.rules import family
from unload.reproduce import heap_table
from unload.reproduce.heap_learning import network_path


@pytest.fixture
def episodes() -> pd.DataFrame:
    """Two policies on four heaps; the learned one brings half a box more on each."""
    rows = []
    for heap, boxes in enumerate((1.0, 2.0, 3.0, 2.0)):
        for policy, more in (("best rule", 0.0), ("learned", 0.5)):
            rows.append(
                {
                    "condition": "as trained",
                    "falls_weight": 1.0,
                    "policy": policy,
                    "heap": heap,
                    "boxes": boxes + more,
                    "falls": 0.5,
                    "net": boxes + more - 0.5,
                }
            )
    return pd.DataFrame(rows)


def test_compared_gives_means_and_ratios_over_pairs(episodes):
    table = heap_table.compared(episodes).set_index("policy")
    assert table.loc["best rule", "boxes"] == 2.0 and table.loc["learned", "boxes"] == 2.5
    assert table.loc["best rule", ["boxes_ratio", "boxes_ratio_low"]].tolist() == [1.0, 1.0]
    learned = table.loc["learned"]
    assert learned["boxes_ratio"] == 1.25
    assert 1.1 < learned["boxes_ratio_low"] < 1.25 < learned["boxes_ratio_high"] < 1.6
    assert learned["net_ratio"] == pytest.approx(2.0 / 1.5)
    assert learned["boxes_low"] < 2.5 < learned["boxes_high"]


def test_pairs_make_the_interval_narrow():
    reference = np.array([1.0, 5.0, 2.0, 8.0])
    ratio, low, high = heap_table.ratio_interval(1.3 * reference, reference)
    assert (ratio, low, high) == pytest.approx((1.3, 1.3, 1.3))
    assert np.isnan(heap_table.ratio_interval(reference, -reference)).all()
    assert np.isnan(heap_table.ratio_interval(reference, np.array([-9.0, 9, 2, 0]))).all()


def test_the_best_rule_depends_on_the_weight_of_falls():
    rules = pd.DataFrame({"rule": ["bold", "shy"], "boxes": [2.0, 1.2], "falls": [1.0, 0.0]})
    assert heap_table.best_rule(rules, 0.0) == "bold"
    assert heap_table.best_rule(rules, 1.0) == "shy"


@pytest.mark.slow
def test_the_table_has_every_policy_and_is_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(heap_table, "HeapEnv", partial(HeapEnv, max_picks=2))
    rules = {name: heap_table.RULES[name] for name in ("random", "lowest")}
    monkeypatch.setattr(heap_table, "RULES", rules)
    some = dict(list(family().items())[:2])
    monkeypatch.setattr(heap_table, "family", lambda: some)
    heap_table.rules_data(1, tmp_path, tmp_path, progress=False)
    for seed in (0, 1):
        network = HeapNetwork("own", 8, torch.Generator().manual_seed(seed))
        save_network(network, network_path(1, "pairs", 0.0, seed, tmp_path))
    arguments = {
        "heaps": 2,
        "physics": "near",
        "conditions": ["as trained", "camera"],
        "weights": [0.0],
        "rounds": 2,
        "variants": [("pairs", 0.0)],
        "oracle": False,
        "folder": tmp_path,
        "runs_dir": tmp_path,
        "progress": False,
    }
    table = heap_table.table_data(**arguments)
    trained = table[(table["condition"] == "as trained") & (table["falls_weight"] == 1.0)]
    learned = [f"learned pairs γ=0{end}" for end in ("", " seed 0", " seed 1")]
    assert set(trained["policy"]) == {*rules, "best rule", *learned}
    camera = table[table["condition"] == "camera"]
    assert set(camera["policy"]) == set(trained["policy"])
    varied = table[table["falls_weight"] == 0.0]
    assert set(varied["policy"]) == {"best rule", "learned pairs γ=0"}
    assert (table["heaps"] == 2).all()
    stored = sorted((tmp_path / "heap" / "episodes").iterdir())
    written = [path.stat().st_mtime_ns for path in stored]
    again = heap_table.table_data(**arguments)
    pd.testing.assert_frame_equal(table, again)
    assert [path.stat().st_mtime_ns for path in stored] == written


def test_unknown_conditions_are_refused(tmp_path):
    with pytest.raises(ValueError, match="a condition is 'rain'; expected one of 'as trained'"):
        heap_table.table_data(conditions=["rain"], folder=tmp_path)
