"""The policies compared where the lift table reaches."""

import pandas as pd
import pytest

from unload import evaluate, policies
from unload.reproduce.policies import comparison
from unload.reproduce.policies.comparison import (
    PLAYERS,
    SIMPLE,
    compare,
    comparison_data,
    digests,
    find_policy,
)
from unload.support import files
from unload.support.provenance import read_provenance


def test_a_comparison_holds_the_rows_of_evaluate():
    rows = compare("highest", policies.highest, True, "σ 5 cm", 2)
    expected = evaluate(policies.highest, 2, comparison.SEED, position_noise=0.05)
    pd.testing.assert_frame_equal(rows[expected.columns], expected)
    assert rows["load"].tolist() == [0, 1]
    assert set(rows["condition"]) == {"σ 5 cm"}


@pytest.mark.parametrize("condition", ["complete", "boxes × 0.8", "boxes × 1.2"])
def test_the_highest_item_never_fails(condition):
    rows = compare("highest", policies.highest, True, condition, 1)
    assert rows["success_rate"].eq(1).all()
    assert condition != "complete" or rows["emptied"].all()


def test_data_and_its_provenance(tmp_path, monkeypatch):
    monkeypatch.setattr(
        comparison, "CONDITIONS", {"500 picks": {}, "σ 2 cm": {"position_noise": 0.02}}
    )
    comparison_data(1, tmp_path, n_jobs=1)
    table = pd.read_csv(tmp_path / "policies/comparison.csv")
    played = table[["condition", "policy", "mask"]].itertuples(index=False, name=None)
    assert list(played) == [(c, *player) for c in ("500 picks", "σ 2 cm") for player in PLAYERS]
    assert read_provenance(tmp_path / "policies", "comparison")["reduced"]


def test_every_rule_has_its_name():
    assert all(find_policy(name) is getattr(policies, name) for name in SIMPLE)


@pytest.mark.parametrize("name", ["comparison", "robustness"])
def test_committed_data_is_of_the_committed_policies(name):
    assert read_provenance(files.DATA / "policies", name)["settings"]["policies"] == digests()
