"""The policies compared where the lift table reaches, and the cards of those that ship."""

import pandas as pd
import pytest

from studies import paths
from studies.fingerprint import training_fingerprint
from studies.policies import comparison
from studies.policies.comparison import (
    PLAYERS,
    compare,
    comparison_data,
    digests,
)
from studies.results import read_provenance
from unload import evaluate, load_policy, policies
from unload.support import files


def test_a_comparison_holds_the_rows_of_evaluate(monkeypatch):
    monkeypatch.setattr(comparison, "LOADS", 2)
    rows = compare("highest", policies.highest, True, "σ 5 cm")
    expected = evaluate(policies.highest, 2, comparison.SEED, position_noise=0.05)
    pd.testing.assert_frame_equal(rows[expected.columns], expected)
    assert rows["load"].tolist() == [0, 1]
    assert set(rows["condition"]) == {"σ 5 cm"}


def test_data_and_its_provenance(tmp_path, monkeypatch):
    monkeypatch.setattr(comparison, "LOADS", 1)
    monkeypatch.setattr(
        comparison, "CONDITIONS", {"500 picks": {}, "σ 2 cm": {"position_noise": 0.02}}
    )
    comparison_data(tmp_path, n_jobs=1)
    table = pd.read_csv(tmp_path / "policies/comparison.csv")
    played = table[["condition", "policy", "mask"]].itertuples(index=False, name=None)
    assert list(played) == [(c, *player) for c in ("500 picks", "σ 2 cm") for player in PLAYERS]
    assert read_provenance(tmp_path / "policies", "comparison")["settings"]["loads"] == 1


@pytest.mark.parametrize("name", ["comparison", "robustness"])
def test_committed_data_is_of_the_committed_policies(name):
    assert read_provenance(paths.DATA / "policies", name)["settings"]["policies"] == digests()


def test_cards_are_measured_and_written(tmp_path, monkeypatch):
    monkeypatch.setattr(comparison, "ORIGINS", {"paper": comparison.ORIGINS["paper"]})
    (tmp_path / "policies").mkdir()
    file = "policies/paper.safetensors"
    (tmp_path / file).write_bytes((files.SHIPPED / file).read_bytes())
    monkeypatch.setattr(comparison, "CARD_LOADS", 2)
    comparison.write_cards(tmp_path)
    card = load_policy(tmp_path / file).card
    assert card == load_policy("paper").card | {
        comparison.loads_of(scale): comparison.measure(load_policy("paper"), scale)
        for scale in comparison.SCALES
    }
    assert card["on the paper's loads"]["picks"] == 1000


@pytest.mark.parametrize("name", comparison.ORIGINS)
def test_what_ships_is_of_todays_training(name):
    card = load_policy(name).card
    assert card["fingerprint"] == training_fingerprint()
    assert card["picks"] == card["configuration"]["picks"]


def test_the_recommended_policy_does_not_miss():
    card = load_policy("recommended").card
    measured = [card[comparison.loads_of(scale)] for scale in comparison.SCALES]
    assert [each["misses"] for each in measured] == [0, 0, 0]
    assert measured[0]["picks"] == 100_000
