"""Jams in a training run; and the runs in seamless walls: their plan, data and measures."""

import re
from dataclasses import replace
from fnmatch import fnmatch
from functools import partial
from shutil import copytree

import numpy as np
import pandas as pd
import pytest

from studies import paths
from studies.falls.laboratory import CONFIG
from studies.grid import read_grid
from studies.results import read_table
from studies.seamless import training
from studies.seamless.jamming import jam
from studies.seamless.training import CELLS, EXPORTED, FIRST_SEED
from studies.statistics import seamless_plan
from unload import task
from unload.agent.training import Training

NAMES = [f"{name}.csv" for name in ("loss_function_agent", "total_rew_function_agent")]


def test_the_jams_of_the_next_episode_are_others():
    """Those of the first are in the published runs."""
    change = partial(jam, share=0.5, lasts=10_000)
    run, found = Training(replace(CONFIG, seed=3, mask=False), change=change), []
    for _ in range(2):
        rows = (np.full(run.config.num_envs, row) for row in range(task.N_VISIBLE))
        found.append(np.stack([run.rollout.envs.unwrapped._lift(row)[1] for row in rows]))
        run.rollout.steps += run.config.max_picks
    free = np.maximum(*found) >= task.LIFT_THRESHOLD
    assert (found[0] != found[1])[free].mean() == pytest.approx(2 / 3, abs=0.1)


def test_the_cells_are_those_of_the_plan():
    plan = (paths.DATA / "seamless" / "PLAN.md").read_text(encoding="utf-8")
    assert f"drawn again within {training.LASTS} successes" in " ".join(plan.split())
    patterns = re.findall(r"`([a-z_0-9.*]+)`", plan[plan.index("## Runs") :])
    assert not [name for name in CELLS if not any(fnmatch(name, each) for each in patterns)]
    assert min(seed for cell in CELLS.values() for seed in cell.seeds) == FIRST_SEED == 40
    assert f"with probability j = {training.SHARE}" in plan


@pytest.mark.parametrize(
    "name",
    ["measured_1.0_mask_order", "until_success_no_mask_order", "weight_1_mask_noise"]
    + ["positions_mask_noise", "shuffled_mask_noise"],
)
def test_the_first_episode_of_a_published_run_is_trained_again(name):
    cell = CELLS[name]
    run = Training(replace(cell.config, seed=FIRST_SEED), change=cell.change)
    for _ in range(500):
        run.step()
    published = read_grid(training.SEAMLESS, cells=[name]).iloc[0]
    found = run.curve.table().iloc[0]
    assert published["seed"] == FIRST_SEED
    for column in ("picks", "success_rate", "loss"):
        assert found[column] == pytest.approx(published[column], rel=1e-4)


def test_the_exported_run_is_the_published_one_and_like_the_papers(tmp_path, monkeypatch):
    curves = read_grid(training.SEAMLESS, cells=[EXPORTED[0]])
    found = seamless_plan(curves[curves["seed"] == EXPORTED[1]])
    assert found["fig11"] and found["fig12"]
    committed = paths.DATA
    copytree(committed / "seamless", tmp_path / "seamless")
    monkeypatch.setattr(paths, "DATA", tmp_path)
    training.export(pd.read_csv(committed / NAMES[1])["Wall time"])
    for name in NAMES:
        assert (tmp_path / name).read_bytes() == (committed / name).read_bytes()


def test_measured_jams_are_those_of_the_published_table():
    first = read_table("seamless/jam_first")
    first = first.assign(share=first["jammed"] / first["free"])
    for friction, shares in training.BY_PLACE.items():
        table = first[first["friction"] == friction]
        found = table.pivot(index="covered", columns="beside", values="share")
        # Three of the twenty episodes had not been played when the plan was written.
        assert found.to_numpy() == pytest.approx(shares, abs=0.1)
