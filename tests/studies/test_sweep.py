"""Many runs side by side: what is kept, what is reported, and who does the work."""

import itertools
import os
from dataclasses import replace

import pandas as pd
import pytest
from joblib import parallel_config

from studies import sweep
from studies.paper.tuning import tuning_config
from tests.agent.runs import CONTAINER
from unload.agent.config import TrainConfig
from unload.agent.identity import unchanged
from unload.agent.training import train
from unload.support import files


@pytest.fixture
def configs():
    """Two tiny runs."""
    return {f"set/run_{run}": tuning_config(8, 1e-3, run, steps=4, n_features=4) for run in (0, 1)}


def without_times(path):
    return pd.read_csv(path).drop(columns="wall_time").to_csv()


def test_runs_equal_single_ones_and_are_kept(configs, tmp_path, capfd):
    report = sweep.run_sweep(configs, tmp_path / "many", n_jobs=1, progress=False)
    assert list(report.index) == list(configs)
    assert (report["error"] == "").all()
    assert report["seed"].tolist() == [0, 1]
    assert capfd.readouterr() == ("", "")
    for name, config in configs.items():
        folder = tmp_path / "many" / name
        assert report.loc[name, "folder"] == str(folder)
        train(config, tmp_path / "alone" / name, progress=False)
        assert without_times(folder / "curve.csv") == without_times(
            tmp_path / "alone" / name / "curve.csv"
        )
        record = files.read_json(folder / "record.json")
        assert '"digest"' in (folder / "record.json").read_text()
        assert record["peak_memory_mib"] > 50 and 0 <= record["wall_time_s"] < 60
        assert "256/256" in (folder / "log.txt").read_text()
    written = sorted(tmp_path.glob("many/set/*/*"))
    before = [path.stat().st_mtime_ns for path in written]
    sweep.run_sweep(configs, tmp_path / "many", n_jobs=1, progress=False)
    assert [path.stat().st_mtime_ns for path in written] == before


def test_a_run_whose_sweep_was_killed_stops_with_a_checkpoint(configs, tmp_path, monkeypatch):
    config = replace(configs["set/run_0"], log_interval=2)
    parents = itertools.chain([1], itertools.repeat(0))  # the sweep, and nobody once it is gone
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt, match="was killed"):
        patch.setattr(os, "getppid", lambda: next(parents))
        sweep._run("run", config, tmp_path / "run", unchanged, sweep=1)
    assert (tmp_path / "run" / "checkpoint.npz").exists()
    sweep.run_sweep({"run": config}, tmp_path, n_jobs=1, progress=False)
    assert (tmp_path / "run" / "policy.safetensors").exists()


def test_a_run_that_fails_is_reported_and_stops_no_other(configs, tmp_path):
    (tmp_path / "set").mkdir()
    (tmp_path / "set" / "run_0").write_text("a file where the run's folder should be")
    report = sweep.run_sweep(configs, tmp_path, n_jobs=1, progress=False)
    assert "run_0" in report["error"].iloc[0]
    assert report["error"].iloc[1] == ""


def test_an_error_in_own_code_is_traced_in_the_runs_log(tmp_path):
    def leaning(run):
        raise RuntimeError("it fell over")

    config = {"run": TrainConfig(**CONTAINER)}
    report = sweep.run_sweep(config, tmp_path, 1, progress=False, changes={"run": leaning})
    assert report["error"].item() == "RuntimeError: it fell over"
    assert "in leaning" in (tmp_path / "run" / "log.txt").read_text()


@pytest.mark.slow
def test_dask_cluster_of_two_processes_equals_loky(configs, tmp_path, capfd):
    distributed = pytest.importorskip("distributed")
    configs = {
        f"run_{run}": tuning_config(8, 1e-3, run, steps=200, n_features=4) for run in range(4)
    }
    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    )
    with cluster, distributed.Client(cluster) as client:
        workers = set(client.run(os.getpid).values())
        with parallel_config("dask"):
            report = sweep.run_sweep(configs, tmp_path / "dask", progress=False)
    assert capfd.readouterr().err == ""
    assert (report["error"] == "").all()
    sweep.run_sweep(configs, tmp_path / "loky", n_jobs=2, progress=False)
    for name in configs:
        curves = [
            without_times(tmp_path / backend / name / "curve.csv") for backend in ("dask", "loky")
        ]
        assert curves[0] == curves[1]
    used = {
        files.read_json(tmp_path / "dask" / name / "record.json")["process"] for name in configs
    }
    assert used == workers
    assert len(used) == 2


def test_runs_that_do_not_fit_the_memory_are_warned_of(configs, tmp_path, monkeypatch):
    config = TrainConfig()  # 1.6 GB each
    pages = {"SC_PHYS_PAGES": 4 * 2**20, "SC_PAGE_SIZE": 1000}
    monkeypatch.setattr(os, "sysconf", pages.get)
    sweep._warn_of_memory({"one": config, "other": config}, 1)
    message = "2 runs at once need 4.3 GB of memory, and this machine has 4.2 GB; take a smaller"
    with pytest.warns(UserWarning, match=message):
        sweep._warn_of_memory({"one": config, "other": config}, 8)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"configs": [1]}, r"configs is \[1\]; expected a dict"),
        ({"folder": None}, "folder is None; expected a path"),
        ({"changes": {"run_7": print}}, "changes is 'run_7'; expected one of 'set/run_0'"),
        ({"n_jobs": 0}, "n_jobs == 0"),
    ],
)
def test_bad_arguments_are_refused_before_anything_runs(configs, tmp_path, arguments, message):
    usual = {"configs": configs, "folder": tmp_path, "progress": False}
    with pytest.raises((TypeError, ValueError), match=message):
        sweep.run_sweep(**usual | arguments)
    assert not list(tmp_path.iterdir())
