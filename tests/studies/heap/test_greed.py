"""Episodes of heaps pick by pick, at reduced size."""

import numpy as np
import pandas as pd
import pytest
import torch

from studies.heap import env as heap_env
from studies.heap import greed
from studies.heap.boxes import Heap
from studies.heap.learning import save_networks
from studies.heap.network import FateNetwork
from studies.heap.recording import HEAPS
from studies.results import read_provenance, read_table


@pytest.mark.pybullet
def test_the_networks_go_on_where_the_rule_has_stopped(own_data, set_in, pile, tmp_path):
    heaps = [pile, pile.only(np.arange(8))]
    networks = tmp_path / "networks.safetensors"
    save_networks([FateNetwork(8, torch.Generator().manual_seed(0))], networks)
    rules = pd.DataFrame({"rule": ["lowest"], "heaps": 1, "boxes": 1.0, "falls": 0.0})
    set_in(greed, stored_heaps=lambda split: heaps, NETWORKS=networks, MAX_PICKS=3, AFTER=(0, 2))
    set_in(greed, read_table=lambda name: rules)
    set_in(heap_env, stored_heaps=lambda split: heaps)
    greed.greed_data()
    frame = read_table("heap/greed")
    assert frame.groupby(["rule_picks", "heap"])["pick"].agg(list).to_dict() == {
        (0, 0): [1, 2, 3], (0, 1): [1, 2, 3], (2, 0): [3], (2, 1): [3],
        (3, 0): [1, 2, 3], (3, 1): [1, 2, 3],
    }  # fmt: skip
    for number, heap in enumerate(heaps):
        counts, left = greed._by_rule("lowest", heap, greed.PHYSICS)
        left = [Heap(**arrays) for arrays in left]
        assert len(left[2]) == len(heap) - counts[:2, 0].sum()
        for rule_picks, expected in (
            (3, counts),
            (2, greed._by_networks(left[2], greed.PHYSICS, 1)),
            (0, greed._by_networks(heap, greed.PHYSICS, 3)),
        ):
            rows = frame[(frame["rule_picks"] == rule_picks) & (frame["heap"] == number)]
            assert rows[["boxes", "falls"]].to_numpy().tolist() == expected.tolist()
    assert read_provenance("heap/greed")["settings"]["rule picks"] == [0, 2]


def test_nets_join_the_rules_picks_and_the_networks(set_in):
    """Two heaps, three picks: the rule brings 1, 2, 3 or 2, 4, 6, the networks 10 a pick."""
    set_in(greed, MAX_PICKS=3, PARTS={"first": (1, 1)})
    rows = [(heap, 3, pick, (heap + 1) * pick, 0) for heap in (0, 1) for pick in (1, 2, 3)]
    rows += [(heap, 1, pick, 12, 2) for heap in (0, 1) for pick in (2, 3)]
    frame = pd.DataFrame(rows, columns=greed.COLUMNS)
    whole = greed.nets(frame, (1, 3))
    assert whole[3].tolist() == [6, 12] and whole[1].tolist() == [21, 22]
    assert greed.nets(frame, (3, 3))[1].tolist() == [10, 10]
    found = greed.ratios(frame)
    assert found.loc[("first", 1), "ratio"] == 1
    assert found.loc[("all 15 picks", 1), "ratio"] == pytest.approx(43 / 18)


def test_published_picks_are_those_of_all_test_heaps():
    frame = read_table("heap/greed")
    assert set(frame["heap"]) == set(range(HEAPS["test"]))
    for rule_picks, picks in ((greed.MAX_PICKS, 15), (0, 15), (10, 5), (11, 4)):
        rows = frame[frame["rule_picks"] == rule_picks]
        assert (rows.groupby("heap").size() == picks).all() and rows["pick"].max() == 15
    settings = read_provenance("heap/greed")["settings"]
    assert settings["physics"] == greed.PHYSICS and settings["rule picks"] == list(greed.AFTER)
