import re
from fnmatch import fnmatch
from shutil import copy

import pandas as pd
import pytest

from studies import grid, paths
from studies.grid import Cell, Grid
from studies.seamless import jam_tables, training, verdicts
from studies.seamless.training import CELLS, FIRST_SEED
from unload import TrainConfig


def test_the_cells_are_those_of_the_plan():
    plan = (paths.DATA / "seamless" / "PLAN.md").read_text()
    patterns = re.findall(r"`([a-z_0-9.*]+)`", plan[plan.index("## Runs") :])
    assert not [name for name in CELLS if not any(fnmatch(name, each) for each in patterns)]
    assert min(seed for cell in CELLS.values() for seed in cell.seeds) == FIRST_SEED == 40


NAMES = [f"{name}.csv" for name in ("loss_function_agent", "total_rew_function_agent")]


def test_a_full_grid_leaves_what_the_papers_plots_read(tmp_path, monkeypatch):
    monkeypatch.setattr(grid, "training_fingerprint", lambda networks: "f")
    config = TrainConfig(picks=64 * 500, batch_size=64, n_features=4, log_interval=500)
    cells = {training.EXPORTED[0]: Cell(config, [training.EXPORTED[1]], training.ANEW)}
    small = Grid("seamless/runs", "make it", cells)
    for name, value in (("SEAMLESS", small), ("CELLS", cells)):
        monkeypatch.setattr(training, name, value)
    training.seamless_data(None, None, tmp_path, tmp_path / "runs", n_jobs=1)
    curve = grid.read_grid(small, tmp_path)
    for name in NAMES:
        table = pd.read_csv(tmp_path / name)
        assert list(table.columns) == ["Wall time", "Step", "Value"]
        assert table["Step"].tolist() == curve["picks"].tolist()
    reward = table["Value"] / 500
    assert ((reward + 1) / 2).tolist() == pytest.approx(curve["success_rate"].tolist(), abs=1e-5)


def test_the_exported_run_is_the_published_one_and_like_the_papers(tmp_path):
    wall_time = pd.read_csv(paths.DATA / NAMES[1])["Wall time"]
    curves = grid.read_grid(training.SEAMLESS, cells=[training.EXPORTED[0]])
    run = curves[curves["seed"] == training.EXPORTED[1]]
    found = verdicts.measures(run)
    assert found["fig11"] and found["fig12"]
    for curve_name in ("runs_success_rate.csv", "runs_loss.csv"):
        (tmp_path / "seamless").mkdir(exist_ok=True)
        copy(paths.DATA / "seamless" / curve_name, tmp_path / "seamless" / curve_name)
    training.export(wall_time, tmp_path)
    for name in NAMES:
        assert (tmp_path / name).read_bytes() == (paths.DATA / name).read_bytes()


def test_measured_jams_are_those_of_the_published_table():
    first = jam_tables.read_first()
    first = first.assign(share=first["jammed"] / first["free"])
    for friction, shares in training.BY_PLACE.items():
        table = first[first["friction"] == friction]
        found = table.pivot(index="covered", columns="beside", values="share")
        # Three of the twenty episodes had not been played when the plan was written.
        assert found.to_numpy() == pytest.approx(shares, abs=0.1)
