"""The paper's hyperparameter grid: names, curves, summary, data."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from unload.env.vector import HighestItemVectorEnv
from unload.reproduce import tuning
from unload.reproduce.figures import tuning as figures
from unload.reproduce.fingerprint import training_fingerprint
from unload.support.provenance import read_provenance


def test_grid_is_the_papers():
    grid = tuning.tuning_grid()
    assert len(grid) == 3 * 4 * 10 * 2
    configs = grid.values()
    assert {config.learning_rate for config in configs} == {1e-1, 1e-2, 1e-3}
    assert {config.batch_size for config in configs} == {64, 256, 1024, 2048}
    assert {config.seed for config in configs} == set(range(10))
    assert {config.picks for config in configs} == {3000 * 64}
    assert {config.env for config in configs} == {"unload/HighestItem-v0"}
    assert {config.equalize for config in configs} == {True, False}


def test_runs_are_named_as_in_the_paper():
    grid = tuning.tuning_grid()
    config = grid["dummy_sim_without_hist_equal/bz_1024_lr_0.1_agent_6"]
    assert (config.batch_size, config.learning_rate, config.seed) == (1024, 0.1, 6)
    assert not config.equalize
    assert grid["dummy_sim_with_hist_equal/bz_64_lr_0.001_agent_9"].equalize


def test_slow_runs_come_first():
    sizes = [config.batch_size for config in tuning.tuning_grid().values()]
    assert sizes == sorted(sizes, reverse=True)


@pytest.mark.parametrize("steps", [0, -1, 2.5])
def test_bad_steps(steps):
    with pytest.raises((TypeError, ValueError), match="steps"):
        tuning.tuning_config(8, 1e-3, 0, steps=steps)


def test_exported_curves_have_one_value_per_step(tmp_path):
    hits = np.arange(65) / 64
    curve = pd.DataFrame({"success_rate": hits, "loss": [np.nan, *np.linspace(1, 1e-6, 64)]})
    tuning.export_curves("dummy_sim_with_hist_equal/bz_8_lr_0.001_agent_0", curve, tmp_path)
    folder = tmp_path / "dummy_sim_with_hist_equal"
    stored = np.loadtxt(folder / "hitrate_curve_bz_8_lr_0.001_agent_0.csv")
    assert (stored == hits).all()
    lines = (folder / "loss_curve_bz_8_lr_0.001_agent_0.csv").read_text().splitlines()
    assert len(lines) == 65
    assert lines[:2] == ["nan", "1"]


def curve(msr, loss):
    return pd.DataFrame({"success_rate": msr, "loss": loss})


def test_summary_of_a_run():
    msr = np.concatenate([np.linspace(0, 1, 500), np.ones(500)])
    loss = np.interp(np.arange(1000), [0, 300, 600, 999], [0.9, 0.1, 0.4, 0.0])
    loss[:10] = np.nan
    summary = tuning.run_summary(msr, loss)
    assert summary["final_msr"] == 1
    assert 480 < summary["solved_at"] < 510
    assert summary["loss_start"] == loss[10]
    assert summary["loss_dip"] == pytest.approx(0.1, abs=0.02)
    assert summary["loss_peak"] == pytest.approx(0.4, abs=0.02)
    assert summary["loss_end"] < 0.1


def test_summary_of_a_run_that_fails_or_solves_at_once():
    failed = tuning.run_summary(np.zeros(200), np.ones(200))
    assert np.isnan(failed["solved_at"])
    assert tuning.run_summary(np.ones(200), np.ones(200))["solved_at"] == 0


def test_summary_has_a_row_per_configuration():
    configs = tuning.tuning_grid([1e-2, 1e-3], [8], runs=2, equalize=[True], steps=200)
    curves = {
        name: curve(np.full(200, config.seed), np.ones(200)) for name, config in configs.items()
    }
    table = tuning.tuning_summary(configs, curves)
    assert table["learning_rate"].tolist() == [1e-3, 1e-2]
    assert table["runs"].tolist() == [2, 2]
    assert table["final_msr"].tolist() == [0.5, 0.5]
    assert table["final_msr_std"].tolist() == pytest.approx([0.5**0.5] * 2)
    assert table["solved"].tolist() == [1, 1]


def test_a_run_without_an_update_has_no_losses():
    summary = tuning.run_summary(np.full(3, 0.5), np.full(3, np.nan))
    assert summary["final_msr"] == 0.5
    assert all(np.isnan(summary[name]) for name in tuning.LOSSES)


def test_tuning_data(tmp_path):
    place = {"folder": tmp_path / "data", "runs_dir": tmp_path / "runs", "progress": False}
    tuning.tuning_data([1e-2], [8], 2, 5, n_jobs=1, **place)
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
    assert provenance["fingerprint"] == training_fingerprint()
    assert provenance["command"] == (
        "python -m unload.reproduce tuning --learning-rates 0.01 --batch-sizes 8 --runs 2 --steps 5"
    )
    # Fewer runs leave no curves of the others behind.
    tuning.tuning_data([1e-2], [8], 1, 5, n_jobs=1, **place)
    assert len(list((tmp_path / "data").glob("dummy_sim_*/*.csv"))) == 4


def test_figures_of_few_runs_say_so(tmp_path):
    tuning.tuning_data(
        [1e-3], [64, 256, 1024, 2048], 1, 3, tmp_path, tmp_path / "runs", 1, progress=False
    )
    for draw in (figures.fig09_batch_size, figures.fig10_loss):
        assert draw(tmp_path).get_supxlabel() == "reduced run: 3 steps, 1 runs"
    with pytest.raises(FileNotFoundError, match="lr_0.1_agent"):
        figures.fig08_learning_rate(tmp_path)
    plt.close("all")


def test_failed_runs_are_named(tmp_path):
    runs = tmp_path / f"runs/tuning/{training_fingerprint()}/5_steps"
    run = runs / "dummy_sim_with_hist_equal/bz_8_lr_0.01_agent_0"
    run.parent.mkdir(parents=True)
    run.write_text("no folder")
    with pytest.raises(RuntimeError, match="dummy_sim_with_hist_equal/bz_8_lr_0.01_agent_0"):
        tuning.tuning_data([1e-2], [8], 1, 5, tmp_path, tmp_path / "runs", n_jobs=1, progress=False)
    assert not (tmp_path / "tuning_summary.csv").exists()


def test_chance_is_the_share_of_the_highest_items():
    env = HighestItemVectorEnv()
    env.reset(seed=0)
    shares = []
    for _ in range(100):
        observations = env.step(np.zeros(64, int))[0]
        heights = observations[..., 2]
        shares.append((heights > heights.max(axis=1, keepdims=True) - 0.01).mean())
    assert tuning.chance() == pytest.approx(np.mean(shares), abs=0.002)


def test_greedy_msr_is_found_again_in_that_of_the_exploring_agent():
    steps = 2000
    greedy = np.linspace(0.2, 1, steps)
    epsilon = np.maximum(0, 1 - np.arange(steps) / 1000)
    mixed = (1 - epsilon) * greedy + epsilon * tuning.chance()
    found = tuning.greedy_msr(np.array([mixed, mixed]))
    assert np.isnan(found[:, :45]).all()
    assert found[:, 60:] == pytest.approx(np.array([greedy, greedy])[:, 60:], abs=0.01)
    reached = tuning.greedy_reached([mixed, mixed])
    assert reached["step"] == pytest.approx(1750, abs=10)
    assert reached["low"] == reached["high"] == reached["step"]


def test_a_level_is_reached_where_the_msr_stays_above_it():
    msr = np.array([[np.nan, 0.95, 0.5, 0.9, 1], [1, 1, 1, 1, 0.5], [1, 1, 1, 1, 1]])
    assert np.array_equal(tuning.reached_at(msr), [3, np.nan, 0], equal_nan=True)
