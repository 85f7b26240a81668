"""Grids of runs, and sweeps: what is kept, published and reported, and who does the work."""

import gc
import itertools
import os
import weakref
from dataclasses import replace
from functools import partial
from unittest.mock import Mock

import numpy as np
import pandas as pd
import pytest
import torch
from joblib import parallel_config

from studies import grid, paths, sweep
from studies.changes import height_reward, shuffled
from studies.paper import tuning
from studies.results import read_provenance, read_table
from tests.agent.runs import assert_same
from unload.agent.config import TrainConfig
from unload.agent.training import train
from unload.support import files

CONFIG = TrainConfig(
    picks=640, num_envs=8, batch_size=64, n_features=4, log_interval=20, replay_size=512
)
CELLS = {
    "plain": grid.cell(CONFIG, (0, 1)),
    "averaged_mask": grid.cell(CONFIG, (3,), mask=True, ties="average"),
    "shuffled": grid.cell(CONFIG, (0,), shuffled),
}
SMALL = grid.Grid("some/small", "make small", CELLS)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Of all tests of the small grid, which is trained once."""
    return tmp_path_factory.mktemp("grid")


@pytest.fixture
def trained(folder, set_in):
    set_in(grid, training_fingerprint=lambda networks: "f")
    set_in(paths, DATA=folder, RUNS=folder / "runs")
    grid.train_grid(SMALL, n_jobs=1)
    return folder


def test_a_grid_is_read_as_it_was_trained(trained):
    curves = grid.read_grid(SMALL)
    runs = dict(list(curves.groupby(["cell", "seed"], sort=False)))
    assert [*runs] == [("plain", 0), ("plain", 1), ("averaged_mask", 3), ("shuffled", 0)]
    # Runs of code that trained otherwise lie elsewhere.
    assert (trained / "runs/some/small/f/full/plain/seed_0/config.json").exists()
    assert all(run["picks"].max() == 640 for run in runs.values())
    plain, changed = (runs[cell, 0]["loss"].dropna().tolist() for cell in ("plain", "shuffled"))
    assert plain != changed
    more = SMALL._replace(cells=CELLS | {"planned": CELLS["plain"]})
    with pytest.raises(ValueError, match=r"some/small.csv has no run of the cells \['planned'\]"):
        grid.read_grid(more, ["planned"])
    policies = grid.read_policies(trained / "some/small.safetensors")
    assert list(policies) == list(SMALL.configs())
    assert policies["averaged_mask/seed_3"].ties == "average"
    first, second = (policies[f"plain/seed_{seed}"].network.state_dict() for seed in (0, 1))
    assert all(not np.array_equal(first[name], second[name]) for name in first)


def published(folder) -> list[bytes]:
    """The published curves and policies of the small grid."""
    return [(folder / f"some/small.{suffix}").read_bytes() for suffix in ("csv", "safetensors")]


def test_no_published_run_is_lost(trained, monkeypatch, tmp_path):
    before = published(trained)
    message = "some/small would lose 1 published runs, averaged_mask/seed_3 first"
    with monkeypatch.context() as patch:
        patch.setattr(paths, "RUNS", trained / "other")
        patch.setattr(grid, "training_fingerprint", lambda networks: "g")  # none is the same
        with pytest.raises(ValueError, match=message):
            grid.train_grid(SMALL, ["plain", "shuffled"], n_jobs=1)
        assert not (trained / "other").exists()  # refused before hours of training
    other = SMALL._replace(cells=CELLS | {"plain": grid.cell(CONFIG, (5, 1, 6))})
    with pytest.raises(ValueError, match="lose 1 published runs, plain/seed_0"):  # as many
        grid.train_grid(other, n_jobs=1)
    grid.train_grid(SMALL, n_jobs=1)
    assert published(trained) == before
    provenance = read_provenance(SMALL.name)
    assert (provenance["runs"], provenance["planned"]) == (4, 4)
    assert provenance["settings"]["averaged_mask"]["mask"] is True


def test_bad_grids_are_refused(trained, monkeypatch):
    for cells in (["plain/seed_00"], "plain/seed_0"):
        with pytest.raises(ValueError, match="cells is 'p.*; expected one of"):
            grid.train_grid(SMALL, cells, n_jobs=1)
    longer = SMALL._replace(cells=CELLS | {"longer": grid.cell(CONFIG, (0,), picks=1280)})
    with pytest.raises(ValueError, match="some/small have points of their curves at other picks"):
        grid.train_grid(longer, n_jobs=1)
    code = trained / "runs/some/small/f/full/shuffled/seed_0/code.json"
    kept = code.read_bytes()
    files.write_json(code, {"code": "another"})
    with pytest.raises(ValueError, match="seed_0 holds a run that was begun with other code"):
        grid.train_grid(SMALL, ["plain"], n_jobs=1)
    code.write_bytes(kept)
    table = trained / "some/small.csv"
    kept = table.read_bytes()
    table.write_bytes(kept[:-20])
    with pytest.raises(ValueError, match="small.csv is not the table of its provenance"):
        grid.train_grid(SMALL, n_jobs=1)
    table.write_bytes(kept)


def test_a_failure_is_said_in_full(trained, monkeypatch):
    rows = {"error": {"plain/seed_0": "ValueError: " + 99 * "why "}}
    monkeypatch.setattr(grid, "run_sweep", lambda *_, **__: pd.DataFrame(rows))
    with pytest.raises(RuntimeError, match=99 * "why "):
        grid.train_grid(SMALL, n_jobs=1)


def test_seeds_are_added_to_those_that_are_published(trained, set_in, tmp_path):
    """Where the folders of the published runs are gone; bytes are those of all runs at once."""
    before = published(trained)
    first = SMALL._replace(cells=CELLS | {"plain": CELLS["plain"]._replace(seeds=(1,))})
    set_in(paths, DATA=tmp_path, RUNS=tmp_path / "first")
    grid.train_grid(first, n_jobs=1)
    assert read_provenance(SMALL.name)["runs"] == 3
    set_in(paths, RUNS=tmp_path / "second")
    grid.train_grid(SMALL, ["plain/seed_0"], n_jobs=1)
    folder = tmp_path / "second/some/small/f/full"
    assert [*folder.glob("*/*")] == [folder / "plain/seed_0"]
    assert published(tmp_path) == before
    provenance = read_provenance(SMALL.name)
    assert (provenance["runs"], provenance["planned"]) == (4, 4)
    assert provenance["versions"]["torch"] == torch.__version__
    # Runs of another configuration do not count.
    other = CELLS | {"plain": grid.cell(CONFIG, (0, 1), learning_rate=0.1)}
    with pytest.raises(ValueError, match="lose 1 published runs, plain/seed_1"):
        grid.train_grid(SMALL._replace(cells=other), ["plain/seed_0"], n_jobs=1)


def test_what_is_measured_of_policies_is_published_with_them(trained):
    cells = {"plain": SMALL.cells["plain"]}
    measured = SMALL._replace(name="some/measured", cells=cells, measure=policy_size)
    grid.train_grid(measured, n_jobs=1)
    rows = [["plain", 0, 4, 0], ["plain", 1, 4, 1]]
    assert read_table("some/measured").to_numpy().tolist() == rows


def policy_size(policy, config) -> dict:
    return {"n_features": policy.network.n_features, "own_seed": config.seed}


@pytest.fixture
def configs():
    """Two tiny runs."""
    tiny = replace(tuning.CONFIG, picks=4 * 64, batch_size=8, n_features=4)
    return {f"set/run_{run}": replace(tiny, seed=run) for run in (0, 1)}


def test_runs_equal_single_ones_and_are_kept(configs, tmp_path, capfd):
    report = sweep.run_sweep(configs, tmp_path / "many", n_jobs=1)
    assert list(report.index) == list(configs)
    assert (report["error"] == "").all()
    assert report["seed"].tolist() == [0, 1]
    assert "2/2" in capfd.readouterr().out
    for name, config in configs.items():
        folder = tmp_path / "many" / name
        assert report.loc[name, "folder"] == str(folder)
        train(config, tmp_path / "alone" / name, progress=False)
        assert_same(folder, tmp_path / "alone" / name)
        assert 0 <= files.read_json(folder / "record.json")["wall_time_s"] < 60
    written = sorted(tmp_path.glob("many/set/*/*"))
    before = [path.stat().st_mtime_ns for path in written]
    sweep.run_sweep(configs, tmp_path / "many", n_jobs=1)
    assert [path.stat().st_mtime_ns for path in written] == before


def test_a_run_of_other_code_is_reported(configs, tmp_path, monkeypatch):
    """The arguments of a change count, and the file that it stands in."""
    one, other = (dict.fromkeys(configs, partial(height_reward, share=s)) for s in (0.5, 0.25))
    for _ in range(2):
        assert (sweep.run_sweep(configs, tmp_path, 1, one)["error"] == "").all()
    message = "holds a run that was begun with other code"
    assert sweep.run_sweep(configs, tmp_path, 1, other)["error"].str.contains(message).all()
    with pytest.raises(TypeError, match="cannot be found by its name"):
        sweep.run_sweep(configs, tmp_path, 1, dict.fromkeys(configs, lambda run: None))
    monkeypatch.setattr("studies.results.getsourcefile", lambda module: __file__)
    assert sweep.run_sweep(configs, tmp_path, 1, one)["error"].str.contains(message).all()


alive = weakref.WeakSet()


def circular(run):
    assert not alive and torch.get_num_threads() == 1
    alive.add(run.replay)
    run.replay.owner = run


def test_the_memory_of_a_run_is_free_before_the_next_one(configs, tmp_path):
    """Also where a change ties the run in a circle, which reference counts never free."""
    threads = torch.get_num_threads()
    torch.set_num_threads(2)
    gc.disable()
    try:
        report = sweep.run_sweep(configs, tmp_path, 1, dict.fromkeys(configs, circular))
        assert torch.get_num_threads() == 2
    finally:
        gc.enable()
        torch.set_num_threads(threads)
    assert (report["error"] == "").all() and len(report) > 1


def test_a_run_whose_sweep_was_killed_stops_with_a_checkpoint(configs, tmp_path, monkeypatch):
    config = replace(configs["set/run_0"], log_interval=2)
    parents = itertools.chain([1], itertools.repeat(0))  # the sweep, and nobody once it is gone
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt, match="was killed"):
        patch.setattr(os, "getppid", lambda: next(parents))
        sweep._run("run", config, tmp_path / "run", None, None, sweep=1)
    assert (tmp_path / "run" / "checkpoint.npz").exists()
    sweep.run_sweep({"run": config}, tmp_path, n_jobs=1)
    assert (tmp_path / "run" / "policy.safetensors").exists()


def test_a_killed_sweep_is_noticed_on_windows_where_its_number_stays(monkeypatch):
    monkeypatch.setattr(sweep, "WINDOWS", True)
    parent = Mock()
    monkeypatch.setattr(sweep.multiprocessing, "parent_process", lambda: parent)
    for alive in (True, False):
        parent.is_alive.return_value = alive
        assert sweep._orphaned(os.getppid()) is not alive


def leaning(run):
    raise RuntimeError("it fell over")


def test_a_run_that_fails_is_reported_and_traced_and_stops_no_other(configs, tmp_path):
    configs["set/leaning"] = configs["set/run_0"]
    (tmp_path / "set").mkdir()
    (tmp_path / "set/run_0").write_text("a file where the run's folder should be", encoding="utf-8")
    report = sweep.run_sweep(configs, tmp_path, n_jobs=1, changes={"set/leaning": leaning})
    blocked, fine, fallen = report["error"]
    assert "run_0" in blocked and fine == "" and fallen == "RuntimeError: it fell over"
    assert "in leaning" in (tmp_path / "set/leaning/log.txt").read_text(encoding="utf-8")


@pytest.mark.slow
def test_dask_cluster_of_two_processes_equals_a_single_one(tmp_path, capfd):
    distributed = pytest.importorskip("distributed")
    tiny = replace(tuning.CONFIG, picks=50 * 64, batch_size=8, n_features=4)
    configs = {f"run_{run}": replace(tiny, seed=run) for run in range(4)}
    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    )
    with cluster, distributed.Client(cluster) as client:
        workers = set(client.run(os.getpid).values())
        with parallel_config("dask"):
            report = sweep.run_sweep(configs, tmp_path / "dask")
    assert capfd.readouterr().err == ""
    assert (report["error"] == "").all()
    sweep.run_sweep(configs, tmp_path / "one", n_jobs=1)
    used = set()
    for name in configs:
        assert_same(tmp_path / "dask" / name, tmp_path / "one" / name)
        used.add(files.read_json(tmp_path / "dask" / name / "record.json")["process"])
    assert used == workers and len(used) == 2
