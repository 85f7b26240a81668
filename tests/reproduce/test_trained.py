"""What trained policies do on fresh containers."""

import json
import shutil

import pandas as pd
import pytest

from unload import evaluate, load_policy
from unload.reproduce.answer import read_answer
from unload.reproduce.measure import LOADS_SEED
from unload.reproduce.trained import CELLS_MEASURED, read_trained, trained_data
from unload.support import files
from unload.support.provenance import read_provenance


@pytest.fixture
def folder(tmp_path):
    """Data of two published runs."""
    for cell in ("paper_no_mask", "ties_by_order_mask"):
        shutil.copytree(
            files.DATA / "answer" / "paper_no_mask",
            tmp_path / "answer" / cell,
            ignore=lambda _, names: [name for name in names if not name.startswith("seed_0")],
        )
    return tmp_path


def test_rows_are_those_of_evaluate(folder):
    trained_data(3, folder, folder / "runs", n_jobs=1, progress=False)
    (row,) = read_trained(folder).to_dict("records")  # those that see otherwise are left out
    assert (row["cell"], row["seed"]) == ("paper_no_mask", 0)
    policy = load_policy(folder / "answer" / "paper_no_mask" / "seed_0.safetensors")
    for name, mask in (("mask", True), ("no_mask", False)):
        rate = evaluate(policy, 3, LOADS_SEED, mask=mask)["success_rate"]
        assert row[f"msr_{name}"] == pytest.approx(rate.mean(), rel=1e-5)
        assert row[f"lowest_{name}"] == pytest.approx(rate.min(), rel=1e-5)
    assert read_provenance(folder / "answer", "trained")["reduced"]


def test_runs_of_other_training_are_refused(folder):
    path = folder / "answer" / "paper_no_mask" / "seed_0.provenance.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"fingerprint": "of old"}))
    with pytest.raises(ValueError, match="seed_0 has the fingerprint of old; expected "):
        trained_data(3, folder, folder / "runs", n_jobs=1, progress=False)
    assert not (folder / "answer" / "trained.csv").exists()


def test_bad_arguments_are_refused(tmp_path):
    with pytest.raises(ValueError, match="loads is 0"):
        trained_data(0, tmp_path)
    with pytest.raises(FileNotFoundError, match="holds no run"):
        trained_data(3, tmp_path)


def test_every_published_run_has_been_measured():
    runs = [(cell, seed) for cell, seed, _ in read_answer() if cell in CELLS_MEASURED]
    table = read_trained()
    assert list(zip(table["cell"], table["seed"])) == runs
    rates = table.drop(columns=["cell", "seed"])
    assert ((0 <= rates) & (rates <= 1)).all(axis=None)
    assert (table["lowest_mask"] <= table["msr_mask"]).all()
    pd.testing.assert_series_equal(
        table["lowest_no_mask"] == 1, table["msr_no_mask"] == 1, check_names=False
    )
