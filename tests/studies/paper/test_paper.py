"""The paper's numbers beside ours, its training, and its search: data, plots and measures."""

from shutil import copy

import numpy as np
import pytest

from studies import grid, paths
from studies.grid import read_policies
from studies.paper import numbers, training, tuning
from studies.paper.training import PAPER
from studies.paper.tuning import tuning_grid
from studies.results import read_table
from unload import load_policy, task
from unload.support import files


def test_what_differs_does_not_agree(set_in):
    """Neither values instead of ranks nor lifts that differ by a little."""
    set_in(numbers, lifted_distance={1: 0.466, 2: 0.0096}.get, equalize=lambda values: values)
    set_in(numbers, CONTAINERS=2, CHANCE_ERROR=0.1)
    agrees = numbers.measured(1, 1, 5)["agrees"]
    assert agrees.tolist()[1:4] == ["no"] * 3 and agrees["MSR of random picks"] == "yes"


def test_policies_play_elsewhere_once_their_cell_is_trained(tmp_path, monkeypatch):
    monkeypatch.setattr(training, "train_grid", lambda *given: None)
    monkeypatch.setattr(files, "SHIPPED", tmp_path)
    training.training_data(["paper_mask"])
    assert not list(tmp_path.iterdir())
    training.training_data()
    policies = read_policies(paths.DATA / "falls/paper.safetensors")
    assert [*policies] == [*PAPER.configs()]
    for seed, name in {0: "paper", 2: "paper_seed_2", 3: "paper_seed_3"}.items():
        weights = policies[f"{training.DEFAULTS}/seed_{seed}"].network.state_dict()
        for each in (name, tmp_path / f"policies/{name}.safetensors"):  # what ships is the same
            stored = load_policy(each).network.state_dict()
            assert all(stored[key].equal(weights[key]) for key in weights)


def test_a_search_is_published_as_one_table(own_data, set_in):
    """Of two batch sizes, two runs each."""
    set_in(grid, training_fingerprint=lambda networks: "f")
    small = tuning_grid([1e-3], [8, 16], runs=2, equalize=[True], steps=20)
    set_in(tuning, TUNING=small, SHOWN=(("with", "loss", 8, 1e-3, 1),))
    tuning.tuning_data(n_jobs=1)
    names = {path.name for path in own_data.iterdir() if path.is_file()}
    assert names == {"tuning.csv", "provenance.json"}
    table = read_table("tuning")
    assert table.shape == (20, 1 + 2 * 2 * 2)
    curves = tuning.read_curves("success_rate", 8, 1e-3)
    assert np.array_equal(curves[1], table["success_rate b8_with_fe/lr_0.001/seed_1"])
    summary = tuning.tuning_summary().set_index("batch_size")
    mean = np.mean([run.mean() for run in curves.values()])
    assert summary.loc[8, "final_msr"] == pytest.approx(mean)
    (path,) = (own_data / "dummy_sim_with_hist_equal").iterdir()
    assert path.name == "loss_curve_bz_8_lr_0.001_agent_1.csv"


def test_committed_files_of_the_papers_plots_are_those_of_the_tables(own_data):
    committed = paths.ROOT / "data"
    copy(committed / "tuning.csv", own_data)
    tuning.export_tuning()
    written = {path.relative_to(own_data) for path in own_data.glob("dummy_sim_*/*")}
    assert written == {path.relative_to(committed) for path in committed.glob("dummy_sim_*/*")}
    assert len(written) == 8
    for path in written:
        assert (own_data / path).read_bytes() == (committed / path).read_bytes()


def test_chance_counts_all_others(monkeypatch):
    """Of three items of two heights: one below is among the highest if both others are below."""
    monkeypatch.setattr(tuning, "GRID", np.array([[0, 0, 0.1], [0, 0, 0.2]]))
    monkeypatch.setattr(task, "N_VISIBLE", 3)
    assert tuning.chance() == pytest.approx(0.5 + 0.5 * 0.25)
