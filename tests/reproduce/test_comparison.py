"""The policies compared where the lift table reaches."""

import pandas as pd
import pytest

from unload import evaluate, policies
from unload.reproduce import comparison
from unload.reproduce.comparison import (
    COMPARED,
    CONDITIONS,
    compare,
    comparison_data,
    find_policy,
    policies_fingerprint,
    policy_digest,
)
from unload.support import files
from unload.support.provenance import read_provenance


def test_a_comparison_holds_the_rows_of_evaluate():
    rows = compare("highest", policies.highest, True, "σ 5 cm", 2)
    expected = evaluate(policies.highest, 2, comparison.SEED, position_noise=0.05)
    pd.testing.assert_frame_equal(rows[expected.columns], expected)
    assert rows["load"].tolist() == [0, 1]
    assert set(rows["condition"]) == {"σ 5 cm"}


def test_the_highest_item_empties_containers_of_every_scale():
    complete = compare("highest", policies.highest, True, "complete", 1)
    assert complete["emptied"].all() and complete["success_rate"].eq(1).all()
    for condition in ("boxes × 0.8", "boxes × 1.2"):
        rows = compare("highest", policies.highest, True, condition, 1)
        assert rows["success_rate"].eq(1).all()


def test_data_and_its_provenance(tmp_path, monkeypatch):
    monkeypatch.setattr(
        comparison, "CONDITIONS", {"500 picks": {}, "σ 2 cm": {"position_noise": 0.02}}
    )
    (tmp_path / "policies").symlink_to(files.DATA / "policies")
    comparison_data(["random", "paper"], 1, tmp_path, n_jobs=1)
    table = pd.read_csv(tmp_path / "comparison.csv")
    played = table[["policy", "mask", "condition"]].drop_duplicates().values.tolist()
    assert played == [
        [name, mask, condition]
        for condition in ("500 picks", "σ 2 cm")
        for name, mask in (("random", True), ("paper", True), ("paper", False))
    ]
    assert read_provenance(tmp_path, "comparison")["reduced"]


def test_what_is_unknown_or_absent_is_refused_by_name(tmp_path):
    with pytest.raises(ValueError, match="name"):
        find_policy("lowest")
    with pytest.raises(FileNotFoundError, match="recommended.safetensors is absent"):
        comparison_data(["recommended"], 1, tmp_path)
    with pytest.raises(ValueError, match="loads"):
        comparison_data(["random"], 0, tmp_path)


def test_every_simple_policy_has_its_name():
    for name in ("random", "nearest", "highest"):
        assert find_policy(name) is getattr(policies, name)
    assert len(COMPARED) == 6 and len(CONDITIONS) == 7


def test_fingerprint_is_that_of_the_training_of_the_policies(tmp_path):
    def write(name, **content):
        files.write_json(tmp_path / f"{name}.provenance.json", content)

    assert policies_fingerprint(["random", "highest"], tmp_path) is None
    assert policies_fingerprint(["paper"], tmp_path) is None
    write("training", fingerprint="one")
    assert policies_fingerprint(["random", "paper", "paper_seed_2"], tmp_path) == "one"
    for recommended, shared in ((None, None), ("other", None), ("one", "one")):
        write("study/recommended", **({"fingerprint": recommended} if recommended else {}))
        assert policies_fingerprint(COMPARED, tmp_path) == shared


@pytest.mark.parametrize("name", ["comparison", "robustness"])
def test_committed_data_is_of_the_committed_policies(name):
    played = read_provenance(files.DATA, name)["settings"]["policies"]
    assert played == {name: policy_digest(name) for name in COMPARED}
