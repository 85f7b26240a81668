"""The heaps, recorded picks, learning and comparison at reduced size."""

import numpy as np
import pandas as pd
import pytest
import torch

from studies import paths
from studies.heap import env as heap_env
from studies.heap import generate, greed, picture, recording
from studies.heap import table as study
from studies.heap.boxes import Heap
from studies.heap.learning import load_networks, save_networks
from studies.heap.network import FateNetwork
from studies.heap.rake import Outcome
from studies.heap.recording import HEAPS, make_networks
from studies.heap.table import best_rule, family
from studies.results import read_provenance, read_table
from unload.drawing.picture import COLOURS


@pytest.mark.pybullet
def test_all_policies_play_the_same_heaps_and_are_kept(own_data, set_in, pile):
    small = [pile, pile.only(np.arange(8))]
    rules = {name: study.RULES[name] for name in ("random", "lowest", "highest")}
    some = dict(list(family().items())[:2])
    set_in(study, stored_heaps=lambda split: small, family=lambda: some, RULES=rules)
    set_in(study, MAX_PICKS=1, PHYSICS="coarse", WEIGHTS=(0.0, 1.0), KEPT=1)
    set_in(study, FIRST_HEAPS=1, RULE_HEAPS=2, TEST_HEAPS=2)
    set_in(heap_env, stored_heaps=study.stored_heaps)
    study.choose_rules()
    rules = read_table("heap/rules")
    assert rules["rule"].tolist() == ["lowest", "highest", *some]
    assert sorted(set(rules["heaps"])) == [1, 2] and (rules["heaps"] == 2).sum() <= 2
    networks = [FateNetwork(8, torch.Generator().manual_seed(seed)) for seed in (0, 1)]
    save_networks(networks, own_data / "heap" / "networks.safetensors")
    study.compare()
    table = read_table("heap/table")
    by = table.set_index(["policy", "falls_weight"])
    curve = [(name, weight) for name in ("best rule", "learned") for weight in (0.0, 1.0)]
    others = [(name, 1.0) for name in ("random", "lowest", "highest", "oracle")]
    assert sorted(by.index) == sorted(curve + others) and (table["heaps"] == 2).all()
    assert by.loc[("oracle", 1.0), "net"] >= by.loc[("random", 1.0), "net"]
    assert read_provenance("heap/table")["settings"]["heaps"] == 2


def test_data_of_heaps_are_those_that_are_read():
    names = {path.name.split(".")[0] for path in (paths.DATA / "heap").iterdir()}
    assert names == {"heaps", "networks", "rules", "greed", "episodes", "table", "provenance"}
    table = read_table("heap/table")
    assert (table["heaps"] == HEAPS["test"]).all() and len(table) == 19
    heaps, networks, rules = (
        read_provenance(f"heap/{name}")["settings"] for name in ("heaps", "networks", "rules")
    )
    assert heaps == {"heaps": HEAPS, "seeds": recording.SEEDS, "boxes dropped": generate.BOXES}
    recorded = {"picks": recording.PICKS, "rounds": recording.ROUNDS, "steps": recording.STEPS}
    assert recorded.items() <= networks.items()
    counts = [study.FIRST_HEAPS, study.RULE_HEAPS]
    assert (rules["heaps"], rules["picks"]) == (counts, study.MAX_PICKS)
    played, best = read_table("heap/rules"), read_provenance("heap/table")["settings"]["best rules"]
    assert played["rule"].tolist() == list(study.candidates())
    assert best == {str(weight): best_rule(played, weight) for weight in study.WEIGHTS}


@pytest.mark.pybullet
def test_a_published_episode_is_played_again():
    """The learned policy at λ = 1 on the smallest heap."""
    place = paths.DATA / "heap"
    episodes = pd.read_csv(place / "episodes.csv").set_index(["policy", "falls_weight", "heap"])
    player = {"networks": place / "networks.safetensors", "falls_weight": 1.0}
    assert len(load_networks(player["networks"])) == recording.NETWORKS
    played = study._play(player, "test", 18, study.PHYSICS)
    assert played == pytest.approx(
        dict(episodes.loc["learned", 1.0, 18][["boxes", "falls"]]), abs=1e-5
    )


class Notes(list):
    """A list that does not tell what it holds, so that it is no part of an identity."""

    def __reduce__(self):
        return Notes, ()


@pytest.mark.pybullet
def test_both_rounds_are_recorded_and_learned_and_kept(own_data, set_in, pile):
    heaps = [pile, pile.only(np.arange(8))]
    set_in(recording, stored_heaps=lambda split: heaps, MAX_PICKS=3, PICKS=12, NETWORKS=2, STEPS=2)
    set_in(heap_env, stored_heaps=recording.stored_heaps)
    fit, learned = recording.fit, Notes()

    def noted_fit(picks, seed, steps):
        learned.append(picks)
        return fit(picks, seed, steps)

    set_in(recording, fit=noted_fit)
    make_networks()
    assert [len(picks) for picks in learned] == [6, 6, 12, 12], "of both rounds in the second"
    picks = learned[-1]
    assert np.isfinite(picks.observations).all() and picks.unloaded.sum() > 0
    came = picks.fates[np.arange(12), picks.actions] & 1
    assert (came <= picks.unloaded).all(), "fates are those of the picks"
    published = own_data / "heap" / "networks.safetensors"
    assert len(load_networks(published)) == 2
    assert read_provenance("heap/networks")["runs"] == 4 + 4
    written = published.read_bytes()
    make_networks()
    assert published.read_bytes() == written and len(learned) == 4, "all of it was kept"


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


def test_a_box_has_the_colour_of_what_a_pick_does_to_it(pile):
    """The dragged one; the others come along or fall."""
    every, expected = np.ones(len(pile), bool), np.tile(COLOURS["tried"], (len(pile), 1))
    for fallen, name in ((every, "failed"), (~every, "liftable")):
        found = picture.outcome_colours(Outcome(pile, every, fallen, 0.7, True), box=1)
        expected[np.arange(len(pile)) != 1] = COLOURS[name]
        assert (found == expected).all()
