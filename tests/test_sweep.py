"""The hyperparameter grid, and running it."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from unload import sweep
from unload.train import train


@pytest.fixture
def configs():
    """Two tiny runs."""
    return [sweep.tuning_config(8, 1e-3, run, steps=4, n_features=4) for run in range(2)]


def test_grid_is_the_papers():
    grid = sweep.tuning_grid()
    assert len(grid) == len({sweep.run_folder(config, ".") for config in grid}) == 3 * 4 * 10 * 2
    assert {config.learning_rate for config in grid} == {1e-1, 1e-2, 1e-3}
    assert {config.batch_size for config in grid} == {64, 256, 1024, 2048}
    assert {config.seed for config in grid} == set(range(10))
    assert {config.picks for config in grid} == {3000 * 64}
    assert {config.env for config in grid} == {"unload/HighestItem-v0"}


def test_runs_are_named_as_in_the_paper():
    config = sweep.tuning_config(1024, 1e-1, 6)
    assert sweep.run_name(config) == "bz_1024_lr_0.1_agent_6"
    assert sweep.set_name(True) == "dummy_sim_with_hist_equal"
    assert sweep.set_name(False) == "dummy_sim_without_hist_equal"


@pytest.mark.slow
def test_runs_side_by_side_equal_single_ones_and_are_kept(configs, tmp_path):
    report = sweep.run_sweep(configs, tmp_path / "many", n_jobs=2)
    assert (report["error"] == "").all()
    for config, folder in zip(configs, report["folder"]):
        alone = train(config, tmp_path / "alone" / str(config.seed), progress=False)
        kept = pd.read_csv(f"{folder}/curve.csv")
        assert kept["loss"].equals(alone.curve["loss"])
    before = [(tmp_path / folder / "curve.csv").stat().st_mtime_ns for folder in report["folder"]]
    sweep.run_sweep(configs, tmp_path / "many", n_jobs=1)
    after = [(tmp_path / folder / "curve.csv").stat().st_mtime_ns for folder in report["folder"]]
    assert before == after


def test_a_run_that_fails_is_reported_and_stops_no_other(configs, tmp_path):
    other = dataclasses.replace(configs[0], n_features=5)
    folder = sweep.run_folder(configs[0], tmp_path)
    train(other, folder, progress=False)  # another configuration sits where run 0 should go
    report = sweep.run_sweep(configs, tmp_path, n_jobs=1)
    assert "n_features (5, not 4)" in report["error"][0]
    assert report["error"][1] == ""


def test_exported_curves_have_one_value_per_step(configs, tmp_path):
    report = sweep.run_sweep(configs[:1], tmp_path, n_jobs=1)
    sweep.export_curves(configs[0], report["folder"][0], tmp_path / "data")
    folder = tmp_path / "data" / "dummy_sim_with_hist_equal"
    hits = np.loadtxt(folder / "hitrate_curve_bz_8_lr_0.001_agent_0.csv")
    assert hits.shape == (4,)
    assert ((hits >= 0) & (hits <= 1)).all()
    assert (folder / "loss_curve_bz_8_lr_0.001_agent_0.csv").read_text().count("\n") == 4


def test_runs_that_would_share_a_folder_are_refused(configs, tmp_path):
    twins = [configs[0], dataclasses.replace(configs[0], n_features=5)]
    with pytest.raises(ValueError, match="2 runs for .*bz_8_lr_0.001_agent_0"):
        sweep.run_sweep(twins, tmp_path)
    assert not list(tmp_path.iterdir())


def test_only_configurations_are_run(tmp_path):
    with pytest.raises(TypeError, match="configs holds 1"):
        sweep.run_sweep([1], tmp_path)


@pytest.mark.parametrize("steps", [0, -1, 2.5])
def test_bad_steps(steps):
    with pytest.raises((TypeError, ValueError), match="steps"):
        sweep.tuning_config(8, 1e-3, 0, steps=steps)
