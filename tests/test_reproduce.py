"""The data behind the figures: files, columns, provenance."""

import numpy as np
import pandas as pd
import pytest

from unload import files, reproduce
from unload.agent import load_policy
from unload.evaluate import evaluate
from unload.provenance import read_provenance
from unload.sweep import set_name


def test_observation_data(tmp_path):
    reproduce.observation_data(seed=3, folder=tmp_path)
    tables = {
        name: pd.read_csv(tmp_path / "obs_hist_equal" / f"{name}.csv")
        for name in ("all_items", "Observation", "Equalized_Observation")
    }
    assert {tuple(table.columns) for table in tables.values()} == {("x", "y")}
    assert 800 <= len(tables["all_items"]) <= 1000
    assert len(tables["Observation"]) == len(tables["Equalized_Observation"]) == 128
    ranks = np.sort(tables["Equalized_Observation"]["x"])
    assert np.allclose(ranks, np.linspace(-1, 1, 128), atol=1e-6)
    items = {tuple(row) for row in tables["all_items"].to_numpy()}
    assert all(tuple(row) in items for row in tables["Observation"].to_numpy())


def test_same_seed_same_data(tmp_path):
    for folder in ("a", "b"):
        reproduce.observation_data(seed=1, folder=tmp_path / folder)
    for name in ("all_items", "Observation"):
        contents = {
            (tmp_path / folder / "obs_hist_equal" / f"{name}.csv").read_bytes() for folder in "ab"
        }
        assert len(contents) == 1


def test_tuning_data(tmp_path):
    runs = ((8, 1e-2, 0, True), (8, 1e-2, 1, False))
    reproduce.tuning_data(runs, steps=5, folder=tmp_path / "data", runs_dir=tmp_path, n_jobs=1)
    name = "loss_curve_bz_8_lr_0.01_agent_1.csv"
    assert (tmp_path / "data/dummy_sim_without_hist_equal" / name).exists()
    provenance = read_provenance(tmp_path / "data", "tuning")
    assert provenance["reduced"]
    assert provenance["settings"]["steps"] == 5
    assert {"command", "revision", "versions", "wall_time_s", "machine"} <= set(provenance)


@pytest.mark.slow
def test_training_data(tmp_path):
    reproduce.training_data(64 * 500, tmp_path / "data", tmp_path / "runs", progress=False)
    for name in ("loss_function_agent", "total_rew_function_agent"):
        table = pd.read_csv(tmp_path / "data" / f"{name}.csv")
        assert list(table.columns) == ["Wall time", "Step", "Value"]
        assert table["Step"].iloc[-1] == 64 * 500
    assert table["Value"].between(-500, 500).all()
    policy = load_policy(tmp_path / "data" / "policies" / "paper.safetensors")
    assert evaluate(policy, 1, max_picks=20)["unloaded"].iloc[0] >= 0
    assert read_provenance(tmp_path / "data", "training")["reduced"]


def test_training_shorter_than_an_episode_is_refused(tmp_path):
    with pytest.raises(ValueError, match="picks is 6400"):
        reproduce.training_data(6400, tmp_path)


def test_committed_data_has_the_papers_files():
    """Every file that the paper's plots read, with its columns, and none too large."""
    for batch_size, rate, run, equalized in reproduce.FIGURE_RUNS:
        folder = files.DATA / set_name(equalized)
        for kind in ("hitrate", "loss"):
            path = folder / f"{kind}_curve_bz_{batch_size}_lr_{rate:g}_agent_{run}.csv"
            assert len(path.read_text().splitlines()) == 3000
    for name in ("loss_function_agent", "total_rew_function_agent"):
        assert list(pd.read_csv(files.DATA / f"{name}.csv")) == ["Wall time", "Step", "Value"]
    assert max(path.stat().st_size for path in files.DATA.rglob("*.csv")) <= 1_000_000
    for folder, name in (
        (files.DATA, "lifts"),
        (files.DATA, "tuning"),
        (files.DATA, "training"),
        (files.DATA / "obs_hist_equal", "observation"),
    ):
        assert read_provenance(folder, name)["command"].startswith("python -m unload.reproduce")
