"""The cards of the policies that come with the package."""

import pytest

from unload import evaluate, load_policy, policies
from unload.reproduce.fingerprint import training_fingerprint
from unload.reproduce.policies import cards
from unload.support import files


def test_cards_are_measured_and_written(tmp_path, monkeypatch):
    monkeypatch.setattr(cards, "ORIGINS", {"paper": cards.ORIGINS["paper"]})
    (tmp_path / "policies").mkdir()
    file = "policies/paper.safetensors"
    (tmp_path / file).write_bytes((files.SHIPPED / file).read_bytes())
    cards.write_cards(loads=2, folder=tmp_path)
    card = load_policy(tmp_path / file).card
    assert card == load_policy("paper").card | {
        cards.loads_of(scale): cards.measure(load_policy("paper"), scale, 2)
        for scale in cards.SCALES
    }
    assert card["on the paper's loads"]["picks"] == 1000


def test_misses_are_counted_as_evaluate_counts_them():
    measured = cards.measure(policies.random, 1.0, 3)
    rates = evaluate(policies.random, 3, cards.SEED)["success_rate"]
    assert measured["misses"] == round(500 * (1 - rates).sum()) > 0
    assert measured["msr"] == pytest.approx(rates.mean(), abs=1e-5)
    assert measured["msr"] > measured["msr_no_mask"]


@pytest.mark.parametrize("name", cards.ORIGINS)
def test_what_ships_is_of_todays_training(name):
    card = load_policy(name).card
    assert card["fingerprint"] == training_fingerprint()
    assert card["picks"] == card["configuration"]["picks"]


def test_the_recommended_policy_does_not_miss():
    card = load_policy("recommended").card
    measured = [card[cards.loads_of(scale)] for scale in cards.SCALES]
    assert [each["misses"] for each in measured] == [0, 0, 0]
    assert measured[0]["picks"] == 100_000
