"""The data behind the figures: files, columns, provenance."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from unload import policies, task
from unload.agent.weights import load_policy
from unload.physics.table import LiftTable
from unload.reproduce import __main__ as reproduce
from unload.reproduce.figures import training, tuning
from unload.reproduce.tuning import run_name, set_name
from unload.support import files
from unload.support.provenance import read_provenance


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
    place = {"folder": tmp_path / "data", "runs_dir": tmp_path / "runs", "progress": False}
    reproduce.tuning_data([1e-2], [8], 2, 5, n_jobs=1, **place)
    data = tmp_path / "data"
    names = {path.relative_to(data).as_posix() for path in data.rglob("*.csv")}
    for folder in ("dummy_sim_with_hist_equal", "dummy_sim_without_hist_equal"):
        for kind in ("hitrate", "loss"):
            for run in (0, 1):
                assert f"{folder}/{kind}_curve_bz_8_lr_0.01_agent_{run}.csv" in names
    summary = pd.read_csv(tmp_path / "data" / "tuning_summary.csv")
    assert summary["equalize"].tolist() == [False, True]
    assert summary["runs"].tolist() == [2, 2]
    provenance = read_provenance(tmp_path / "data", "tuning")
    assert provenance["reduced"]
    assert provenance["settings"]["steps"] == 5
    assert provenance["settings"]["config"]["batch_size"] == 8
    assert provenance["runs"] == 4
    assert provenance["command"] == (
        "python -m unload.reproduce tuning --learning-rates 0.01 --batch-sizes 8 --runs 2 --steps 5"
    )
    # Fewer runs leave no curves of the others behind.
    reproduce.tuning_data([1e-2], [8], 1, 5, n_jobs=1, **place)
    assert len(list((tmp_path / "data").glob("dummy_sim_*/*.csv"))) == 4


def test_figures_of_few_runs_say_so(tmp_path):
    reproduce.tuning_data(
        [1e-3], [64, 256, 1024, 2048], 1, 3, tmp_path, tmp_path / "runs", 1, progress=False
    )
    for draw in (tuning.fig09_batch_size, tuning.fig10_loss):
        assert draw(tmp_path).get_supxlabel() == "reduced run: 3 steps, 1 runs"
    with pytest.raises(FileNotFoundError, match="lr_0.1_agent"):
        tuning.fig08_learning_rate(tmp_path)
    plt.close("all")


def test_failed_runs_are_named(tmp_path):
    run = tmp_path / "runs/tuning/5_steps/dummy_sim_with_hist_equal/bz_8_lr_0.01_agent_0"
    run.parent.mkdir(parents=True)
    run.write_text("no folder")
    with pytest.raises(RuntimeError, match="dummy_sim_with_hist_equal/bz_8_lr_0.01_agent_0"):
        reproduce.tuning_data(
            [1e-2], [8], 1, 5, tmp_path, tmp_path / "runs", n_jobs=1, progress=False
        )
    assert not (tmp_path / "tuning_summary.csv").exists()


@pytest.mark.slow
def test_training_data(tmp_path, monkeypatch):
    monkeypatch.setattr(reproduce, "EVALUATION", {"episodes": 2, "seed": 1})
    picks, seeds = 64 * 500, (3, 5)
    data = tmp_path / "data"
    reproduce.training_data(picks, seeds, data, tmp_path / "runs", n_jobs=1, progress=False)
    for name in ("loss_function_agent", "total_rew_function_agent"):
        for suffix in ("", "_seed_5"):
            table = pd.read_csv(data / f"{name}{suffix}.csv")
            assert list(table.columns) == ["Wall time", "Step", "Value"]
            assert table["Step"].iloc[-1] == picks
    assert table["Value"].between(-500, 500).all()
    for suffix in ("", "_seed_5"):
        stored = load_policy(data / "policies" / f"paper{suffix}.safetensors")
        trained = load_policy(
            tmp_path / f"runs/training/{picks}_picks/seed_{5 if suffix else 3}/policy.safetensors"
        )
        weights = [policy.network.state_dict() for policy in (stored, trained)]
        assert all(weights[0][name].equal(weights[1][name]) for name in weights[1])
    summary = pd.read_csv(data / "training_summary.csv")
    assert summary["seed"].tolist() == [3, 5]
    rates = summary.filter(regex="^msr_(start|end|best|mask|no_mask)$")
    assert rates.shape == (2, 5)
    assert ((rates >= 0) & (rates <= 1)).all(axis=None)
    assert (summary["msr_best"] >= summary[["msr_start", "msr_end"]].max(axis=1)).all()
    curves = pd.read_csv(data / "training_curves.csv")
    assert curves["picks"].tolist() == [32_000] * 2
    reward = pd.read_csv(data / "total_rew_function_agent.csv")["Value"]
    assert np.allclose((reward / 500 + 1) / 2, curves["success_rate"][:1], atol=1e-5)
    provenance = read_provenance(data, "training")
    assert provenance["reduced"]
    assert provenance["settings"]["picks"] == picks
    assert provenance["command"].endswith("training --picks 32000 --seeds 3 5")
    for draw, label in ((training.fig11_loss, "loss"), (training.fig12_reward, "mean")):
        (axes,) = draw(data).axes
        assert len(axes.lines) == 2
        assert label in axes.get_ylabel()
    plt.close("all")


def test_training_shorter_than_an_episode_is_refused(tmp_path):
    with pytest.raises(ValueError, match="picks is 6400"):
        reproduce.training_data(6400, folder=tmp_path)


def test_lift_data_depends_on_the_command_alone(tmp_path, monkeypatch):
    monkeypatch.setattr(task, "NUM_ENVS", 1)
    monkeypatch.setattr(reproduce, "_tastes", lambda rng: [policies.random, policies.highest])
    for name in "ab":
        reproduce.lift_data(1, 0, tmp_path / name, tmp_path / name / "runs", progress=False)
    assert (tmp_path / "a/lifts.npz").read_bytes() == (tmp_path / "b/lifts.npz").read_bytes()
    lifts = len(LiftTable.load(tmp_path / "a/lifts.npz"))
    assert lifts > 50
    provenance = read_provenance(tmp_path / "a", "lifts")
    assert provenance["settings"]["lifts"] == lifts
    # What is kept is not computed again.
    reproduce.lift_data(1, 0, tmp_path / "c", tmp_path / "a/runs", progress=False)
    again = read_provenance(tmp_path / "c", "lifts")
    assert again["wall_time_s"] == provenance["wall_time_s"]


def test_policies_that_fill_the_table_only_pick_what_the_mask_allows(rng):
    observations = rng.uniform(-1, 1, (50, 128, 3)).astype(np.float32)
    masks = rng.random((50, 128)) < 0.2
    masks[:, 0] = True
    tastes = reproduce._tastes(rng)
    assert len(tastes) == 20 + reproduce.RANDOM_SHARE
    for policy in tastes:
        actions = policy(observations, masks, rng)
        assert np.take_along_axis(masks, actions[:, None], axis=1).all()


def test_committed_data_has_the_papers_files():
    """Every file that the paper's plots read, with its columns, and none too large."""
    for equalized, batch_size, rate, run in (
        (True, 1024, 1e-1, 6),
        (True, 1024, 1e-2, 7),
        (True, 1024, 1e-3, 5),
        (True, 64, 1e-3, 9),
        (True, 256, 1e-3, 9),
        (True, 2048, 1e-3, 6),
        (False, 2048, 1e-3, 8),
    ):
        for kind in ("hitrate", "loss"):
            name = f"{kind}_curve_{run_name(batch_size, rate, run)}.csv"
            assert len((files.DATA / set_name(equalized) / name).read_text().splitlines()) == 3000
    for name in ("loss_function_agent", "total_rew_function_agent"):
        assert list(pd.read_csv(files.DATA / f"{name}.csv")) == ["Wall time", "Step", "Value"]
    sizes = [path.stat().st_size for path in files.DATA.rglob("*") if path.is_file()]
    assert max(sizes) <= 1_000_000
    assert sum(sizes) <= 25_000_000
    for folder, name in (
        (files.DATA, "lifts"),
        (files.DATA, "tuning"),
        (files.DATA, "training"),
        (files.DATA / "obs_hist_equal", "observation"),
    ):
        assert read_provenance(folder, name)["command"].startswith("python -m unload.reproduce")
