"""The paper's search: its data, what its plots read of it, and what is measured of it."""

from shutil import copytree

import numpy as np
import pytest

from studies import grid, paths
from studies.paper import tuning
from studies.paper.tuning import tuning_grid
from studies.results import read_table


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
