"""Policies compared on heaps, at reduced size."""

from functools import partial

import pandas as pd
import pytest
import torch

from unload.heap.env import HeapEnv, stored_heaps
from unload.heap.learning import save_network
from unload.heap.network import HeapNetwork
from unload.heap.rules import family
from unload.reproduce import heap, heap_episodes, heap_rules, heap_table
from unload.reproduce.heap_learning import VARIANTS, network_path
from unload.reproduce.heap_variation import varied_path


@pytest.fixture
def episodes() -> pd.DataFrame:
    """Two policies on four heaps; the learned one brings half a box more on each."""
    rows = []
    for number, boxes in enumerate((1.0, 2.0, 3.0, 2.0)):
        for policy, more in (("best rule", 0.0), ("learned", 0.5)):
            rows.append(
                {
                    "condition": "as trained",
                    "falls_weight": 1.0,
                    "policy": policy,
                    "heap": number,
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
    assert learned[["net_more", "net_more_low", "net_more_high"]].tolist() == [0.5, 0.5, 0.5]
    rule = table.loc["best rule"]
    assert rule["base"] == "learned" and rule["net_to_base"] == -0.5


def test_a_variant_is_compared_with_the_one_that_it_differs_from_in_one_thing(episodes):
    names = {"learned": "own row", "best rule": "linear"}
    table = heap_table.compared(
        pd.concat([episodes, episodes.replace({"policy": names}), episodes]).drop_duplicates()
    ).set_index("policy")
    assert table.loc["linear", "base"] == "own row" and table.loc["linear", "net_to_base"] == -0.5
    assert table.loc["own row", "base"] == "pooled" and table["net_to_base"].isna()["own row"]


def test_a_policy_on_fewer_heaps_is_compared_on_those(episodes):
    few = episodes[(episodes["policy"] == "learned") & (episodes["heap"] < 2)]
    rest = episodes[episodes["policy"] == "best rule"]
    table = heap_table.compared(pd.concat([rest, few])).set_index("policy")
    row = table.loc["learned"]
    assert row["heaps"] == 2 and row["boxes"] == 2.0
    assert row["boxes_ratio"] == pytest.approx(2.0 / 1.5) and row["net_more"] == 0.5


def save_networks(folder, count=2):
    for seed in range(count):
        network = HeapNetwork("own", 8, torch.Generator().manual_seed(seed))
        for variant in VARIANTS.values():
            save_network(network, network_path(1, variant, seed, folder))


def test_the_plan_plays_what_is_worth_it(tmp_path):
    """All policies at the λ of the table; few of them elsewhere."""
    save_networks(tmp_path, 5)
    rules = pd.DataFrame(
        {"rule": list(family())[:2], "heaps": [20, 20], "boxes": [2, 1], "falls": [1, 0]}
    )
    cells = heap_table.plan(rules, runs_dir=tmp_path)
    of = {}
    for cell in cells:
        of.setdefault((cell.condition, cell.falls_weight), []).append(cell.policy)
    shown = of.pop(("as trained", 1.0))
    assert len(shown) == len(set(shown)) == 22
    assert {"oracle", "seed 4", *VARIANTS, *heap_table.RULES} <= set(shown)
    few = {"random", "best rule", "learned"}
    for (condition, weight), policies in of.items():
        wanted = {"best rule", "linear", "learned"} if condition == "as trained" else few
        assert set(policies) == wanted and len(policies) == len(wanted), (condition, weight)
    assert len(of) == 11
    assert {cell.heaps for cell in cells if cell.policy != "oracle"} == {30}
    assert [cell.heaps for cell in cells if cell.policy == "oracle"] == [30]
    assert sum(cell.heaps for cell in cells) / 30 < 60
    with pytest.raises(FileNotFoundError, match="heap-variation makes it"):
        heap_table.plan(rules, varied_rules=rules, runs_dir=tmp_path)


@pytest.mark.slow
def test_the_table_has_every_policy_and_is_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(heap_episodes, "HeapEnv", partial(HeapEnv, max_picks=2))
    rules = {name: heap_table.RULES[name] for name in ("random", "lowest")}
    monkeypatch.setattr(heap_table, "RULES", rules)
    some = dict(list(family().items())[:2])
    monkeypatch.setattr(heap_rules, "family", lambda: some)
    monkeypatch.setattr(heap, "settled_heap", lambda *given: stored_heaps("train")[0])
    heap_rules.rules_data(1, tmp_path, tmp_path, progress=False)
    save_networks(tmp_path)
    save_network(HeapNetwork("own", 8), varied_path(0, tmp_path))
    arguments = {
        "heaps": 2,
        "physics": "near",
        "conditions": ["as trained", "camera", "boxes × 0.8"],
        "weights": [0.0],
        "rounds": 2,
        "variants": {"learned": VARIANTS["learned"]},
        "oracle_heaps": 0,
        "variation": True,
        "folder": tmp_path,
        "runs_dir": tmp_path,
        "progress": False,
    }
    table = heap_table.table_data(**arguments)
    varied = ["rule chosen with variation", "trained with variation"]
    trained = table[(table["condition"] == "as trained") & (table["falls_weight"] == 1.0)]
    learned = ["learned", "seed 0", "seed 1"]
    assert set(trained["policy"]) == {
        *rules,
        "best rule",
        *learned,
        "by probability",
        *varied,
    }
    for condition in ("camera", "boxes × 0.8"):
        few = {"random", "best rule", "learned", *varied}
        assert set(table["policy"][table["condition"] == condition]) == few
    curve = table[table["falls_weight"] == 0.0]
    assert set(curve["policy"]) == {"best rule", "learned"}
    assert (table["heaps"] == 2).all()
    episodes = pd.read_csv(tmp_path / "heap" / "episodes.csv")
    boxes = episodes[(episodes["policy"] == "random")].groupby("condition")["boxes"].sum()
    assert boxes["as trained"] != boxes["boxes × 0.8"], "other heaps"
    stored = sorted((tmp_path / "heap" / "episodes").iterdir())
    written = [path.stat().st_mtime_ns for path in stored]
    again = heap_table.table_data(**arguments)
    pd.testing.assert_frame_equal(table, again)
    assert [path.stat().st_mtime_ns for path in stored] == written


def test_unknown_conditions_and_missing_rules_are_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="heap-rules makes it"):
        heap_table.table_data(folder=tmp_path)
    with pytest.raises(ValueError, match="a condition is 'rain'; expected one of 'as trained'"):
        heap_table.table_data(conditions=["rain"], folder=tmp_path)
