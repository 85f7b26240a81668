"""The paper's search: its data, what its plots read of it, and what is measured of it."""

from shutil import copytree

import numpy as np
import pytest

from studies import grid, paths
from studies.paper import tuning
from studies.paper.tuning import tuning_grid
from studies.results import read_table
from unload import task
from unload.env.highest_item import HighestItemVectorEnv


def test_a_search_is_published_in_two_tables_a_batch_size(own_data, monkeypatch):
    """Of two batch sizes, two runs each."""
    monkeypatch.setattr(grid, "training_fingerprint", lambda networks: "f")
    small = tuning_grid([1e-3], [8, 16], runs=2, equalize=[True], steps=20)
    monkeypatch.setattr(tuning, "TUNING", small)
    monkeypatch.setattr(tuning, "SHOWN", (("with", "loss", 8, 1e-3, 1),))
    tuning.tuning_data(n_jobs=1)
    names = {path.name for path in (own_data / "tuning").iterdir()}
    tables = {f"b{size}_{column}.csv" for size in (8, 16) for column in ("loss", "success_rate")}
    assert names == tables | {"tuning.provenance.json"}
    table = read_table("tuning/b8_success_rate")
    assert table.shape == (20, 1 + 2)
    curves = tuning.read_curves("success_rate", 8, 1e-3)
    assert np.array_equal(curves[1], table["b8/with_fe_lr_0.001/seed_1"])
    summary = tuning.tuning_summary().set_index("batch_size")
    assert summary["runs"].tolist() == [2, 2]
    mean = np.mean([run.mean() for run in curves.values()])
    assert summary.loc[8, "final_msr"] == pytest.approx(mean)
    (path,) = (own_data / "dummy_sim_with_hist_equal").iterdir()
    assert path.name == "loss_curve_bz_8_lr_0.001_agent_1.csv"
    lines = path.read_text().splitlines()
    losses = tuning.read_curves("loss", 8, 1e-3)[1]
    assert lines[0] == "nan" and np.array_equal(np.array(lines, float), losses, equal_nan=True)


def test_committed_files_of_the_papers_plots_are_those_of_the_tables(own_data):
    committed = paths.ROOT / "data"
    copytree(committed / "tuning", own_data / "tuning")
    tuning.export_tuning()
    written = {path.relative_to(own_data) for path in own_data.glob("dummy_sim_*/*")}
    assert written == {path.relative_to(committed) for path in committed.glob("dummy_sim_*/*")}
    assert len(written) == 8
    for path in written:
        assert (own_data / path).read_bytes() == (committed / path).read_bytes()


def test_the_search_has_240_runs_of_which_slow_ones_come_first():
    sizes = [config.batch_size for config in tuning.TUNING.configs().values()]
    assert len(sizes) == 240 and sizes == sorted(sizes, reverse=True)


def test_summary_of_a_run():
    msr = np.concatenate([np.linspace(0, 1, 500), np.ones(500)])
    loss = np.interp(np.arange(1000), [0, 300, 600, 999], [0.9, 0.1, 0.4, 0.0])
    loss[:10] = np.nan
    summary = tuning.run_summary(msr, loss)
    assert summary["final_msr"] == 1 and summary["solved"]
    assert not tuning.run_summary(0.98 * msr, loss)["solved"]
    assert summary["loss_start"] == loss[10]
    assert summary["loss_dip"] == pytest.approx(0.1, abs=0.02)
    assert summary["loss_peak"] == pytest.approx(0.4, abs=0.02)
    assert summary["loss_end"] < 0.1


def test_chance_is_the_share_of_the_highest_items():
    env = HighestItemVectorEnv()
    env.reset(seed=0)
    shares = []
    for _ in range(100):
        observations = env.step(np.zeros(64, int))[0]
        heights = observations[..., 2]
        shares.append((heights > heights.max(axis=1, keepdims=True) - 0.01).mean())
    assert tuning.chance() == pytest.approx(np.mean(shares), abs=0.002)


def test_chance_counts_all_others(monkeypatch):
    """Of three items of two heights: one below is among the highest if both others are below."""
    monkeypatch.setattr(tuning, "GRID", np.array([[0, 0, 0.1], [0, 0, 0.2]]))
    monkeypatch.setattr(task, "N_VISIBLE", 3)
    assert tuning.chance() == pytest.approx(0.5 + 0.5 * 0.25)


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


def test_a_rate_is_reached_where_it_stays_until_the_end():
    never, late, always = [0.95, 0.95, 0.89], [0.95, 0.2, 0.9], [0.9, 0.91, 0.92]
    found = tuning.reached_at(np.array([never, late, always, [np.nan, 0.95, 0.95]]))
    assert np.isnan(found[0]) and found[1:].tolist() == [2, 0, 1]
