"""Jams in a training run; and the runs in seamless walls: their plan, data and measures."""

import re
from dataclasses import replace
from fnmatch import fnmatch
from functools import partial
from shutil import copytree

import numpy as np
import pandas as pd
import pytest

from studies import grid, paths
from studies.falls.laboratory import CONFIG
from studies.grid import Cell, Grid, read_grid
from studies.results import read_table
from studies.seamless import training
from studies.seamless.jamming import jam, neighbours, uniform, weigh
from studies.seamless.jams import place
from studies.seamless.training import CELLS, EXPORTED, FIRST_SEED
from studies.statistics import seamless_plan
from tests.studies.curves import curve
from unload import TrainConfig, task
from unload.agent.training import Training
from unload.env.observation import nearest
from unload.load.boxes import Load

SMALL = replace(CONFIG, picks=64 * 500, log_interval=500, seed=3, mask=False)


@pytest.fixture
def random_run():
    """A run whose picks are all random; its environments are closed at the end."""
    runs = []

    def make(change, **fields) -> Training:
        runs.append(Training(replace(SMALL, epsilon_final=1.0, **fields), change=change))
        return runs[-1]

    yield make
    for run in runs:
        run.rollout.close()


def attempts(run, row) -> np.ndarray:
    """How far the items in a row of the 64 containers would be lifted now, m."""
    return run.rollout.envs.unwrapped._look_up(np.full(64, row))[1]


def all_attempts(run) -> np.ndarray:
    """The same of all rows, (128, 64)."""
    return np.stack([attempts(run, row) for row in range(128)])


def test_uniform_numbers_are_uniform_and_independent():
    drawn = uniform(7, np.arange(400)[:, None], np.arange(500))
    assert 0 <= drawn.min() and drawn.max() < 1
    assert np.histogram(drawn, 10, (0, 1))[0] == pytest.approx(20_000, rel=0.03)
    for axis in (0, 1):  # neighbours along either counter
        pair = np.corrcoef(
            drawn.take(range(399), axis).ravel(), drawn.take(range(1, 400), axis).ravel()
        )
        assert abs(pair[0, 1]) < 0.01
    assert (uniform(8, np.arange(9)) != uniform(7, np.arange(9))).all()


def test_the_share_of_free_boxes_jams_and_no_other_lift_changes(random_run):
    plain, jammed = random_run(lambda run: None), random_run(partial(jam, share=0.4))
    without, found = all_attempts(plain), all_attempts(jammed)
    free = without >= task.LIFT_THRESHOLD
    assert (found[~free] == without[~free]).all()
    stuck = found[free] == 0
    assert (found[free][~stuck] == without[free][~stuck]).all()
    assert stuck.mean() == pytest.approx(0.4, abs=0.03)


@pytest.mark.parametrize(("share", "start"), [(0.0, 0.264), (0.4, 0.158), (1.0, 0.0)])
def test_random_picks_succeed_the_less_the_more_boxes_jam(random_run, share, start):
    run = random_run(partial(jam, share=share))
    while not run.rollout.finished:
        run.step()
    # A whole episode of 64 containers; without jams the rate falls faster, because more is dug.
    assert run.curve.table()["success_rate"].iloc[0] == pytest.approx(start, abs=0.012)


@pytest.mark.parametrize("lasts", [0, 1])
def test_a_jam_ends_at_the_next_attempt_or_success(random_run, lasts):
    run = random_run(partial(jam, share=0.5, lasts=lasts))
    state = run.rollout.envs.unwrapped._containers
    first = all_attempts(run)
    run.rollout.steps += 1
    state.masks[:] = 0
    second = all_attempts(run)
    free = np.maximum(first, second) >= task.LIFT_THRESHOLD
    assert (first[free] != second[free]).mean() == pytest.approx(2 / 3 * (lasts == 0), abs=0.1)
    state.unloaded[:] += 1
    assert (all_attempts(run) != first).any()


def test_a_jam_lasts_for_some_successes(random_run):
    """Redrawn after ten successes, at a moment of its own: after one, a tenth has been drawn."""
    run = random_run(partial(jam, share=0.5, lasts=10))
    state = run.rollout.envs.unwrapped._containers
    first, changed = all_attempts(run), []
    for _ in range(20):
        state.unloaded[:] += 1
        now = all_attempts(run)
        free = np.maximum(first, now) >= task.LIFT_THRESHOLD
        changed.append((first[free] != now[free]).mean())
    assert changed[0] == pytest.approx(0.1 * changed[-1], rel=0.35)
    assert changed[4] == pytest.approx(0.5 * changed[-1], rel=0.25)
    assert changed[-1] == pytest.approx(changed[9], rel=0.15)  # all of them are drawn again


def test_the_jams_of_the_next_episode_are_others(random_run):
    run = random_run(partial(jam, share=0.5, lasts=10_000))
    first = all_attempts(run)
    run.rollout.steps += run.config.max_picks
    second = all_attempts(run)
    free = np.maximum(first, second) >= task.LIFT_THRESHOLD
    assert (first[free] != second[free]).mean() == pytest.approx(2 / 3, abs=0.1)


def test_a_masked_box_is_tried_again_and_its_mask_is_kept(random_run):
    run = random_run(partial(jam, share=0.0))
    state = run.rollout.envs.unwrapped._containers
    before = attempts(run, 5)
    state.masks[:, 5] = 0
    state.failed[:, 5] = 0.123
    assert (attempts(run, 5) == before).all()
    assert (state.masks[:, 5] == 0).all()


def test_a_weight_changes_what_is_visible(random_run):
    run = random_run(partial(weigh, z=1.0), max_picks=10)
    envs = run.rollout.envs.unwrapped
    first = envs._containers.geometry.copy()
    for _ in range(10):
        run.step()
    assert (envs._containers.geometry != first).any()  # after an episode other loads stand there
    seen = envs._containers.seen[0]
    count = envs._containers.present[0].sum()  # all are still there
    positions = (seen[:count] + 1) / 2 * task.CONTAINER
    distances = (task.VIEWPOINT - positions) ** 2 @ [1, 0, 1]
    expected = np.argsort(distances)[:128]
    assert len(np.setdiff1d(envs.visible[0], expected)) <= 1  # float32 positions may tie
    assert len(np.setdiff1d(envs.visible[0], nearest(positions))) > 5


def test_neighbours_are_those_of_the_measured_places(random_run):
    run = random_run(lambda run: None)
    for _ in range(40):
        run.step()
    envs = run.rollout.envs.unwrapped
    state, seen = envs._containers, set()
    for row in range(0, 128, 9):
        items = state.visible[:, row].astype(np.int64)
        covered, beside = neighbours(state, items)
        for env in range(0, 64, 7):
            count = int(np.flatnonzero(state.present[env])[-1]) + 1
            boxes = state.geometry[env, :count]
            walls = np.unique(boxes[:, 0] - boxes[:, 3] / 2, return_inverse=True)[1]
            load = Load(boxes[:, :3], boxes[:, 3:], np.zeros(count, int), walls)
            found = place(load, state.present[env, :count].astype(bool), int(items[env]))
            assert (covered[env], beside[env]) == (found["covered"], found["beside"])
            seen.add((found["covered"], found["beside"]))
    assert len(seen) >= 6


NAMES = [f"{name}.csv" for name in ("loss_function_agent", "total_rew_function_agent")]


def test_the_cells_are_those_of_the_plan():
    plan = (paths.DATA / "seamless" / "PLAN.md").read_text()
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
    run.rollout.close()
    published = read_grid(training.SEAMLESS, cells=[name]).iloc[0]
    found = run.curve.table().iloc[0]
    assert published["seed"] == FIRST_SEED
    for column in ("picks", "success_rate", "loss"):
        assert found[column] == pytest.approx(published[column], rel=1e-4)


def test_a_full_grid_leaves_what_the_papers_plots_read(own_data, monkeypatch):
    monkeypatch.setattr(grid, "training_fingerprint", lambda networks: "f")
    config = TrainConfig(picks=64 * 500, batch_size=64, n_features=4, log_interval=500)
    cells = {EXPORTED[0]: Cell(config, [EXPORTED[1]], training.ANEW)}
    small = Grid("seamless/runs", "make it", cells)
    for name, value in (("SEAMLESS", small), ("CELLS", cells)):
        monkeypatch.setattr(training, name, value)
    training.seamless_data(n_jobs=1)
    curve = read_grid(small)
    for name in NAMES:
        table = pd.read_csv(own_data / name)
        assert list(table.columns) == ["Wall time", "Step", "Value"]
        assert table["Step"].tolist() == curve["picks"].tolist()
    reward = table["Value"] / 500
    assert ((reward + 1) / 2).tolist() == pytest.approx(curve["success_rate"].tolist(), abs=1e-5)
    # Neither of other cells nor of shorter runs.
    monkeypatch.setattr(training, "train_grid", lambda *_: own_data)
    monkeypatch.setattr(training, "export", lambda *_: pytest.fail("exported"))
    training.seamless_data(["mask_order"])
    training.seamless_data(None, 64_000)


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


RISE = np.linspace(0.2, 0.5, 20)


@pytest.mark.parametrize(
    ("figure", "run", "like"),
    [
        ("fig12", curve([0.15, 0.6, 0.6]), True),
        ("fig12", curve([0.26, 0.6, 0.6]), False),  # the start
        ("fig12", curve([0.15, 0.6, 0.75]), False),  # the end
        ("fig12", curve([0.15, 0.6, 0.45]), False),
        ("fig12", curve([0.15, 0.6, 0.56, 0.6]), True),  # four points down
        ("fig12", curve([0.15, 0.6, 0.53, 0.6]), False),
        ("fig11", curve([0.5], loss=[0.3, 0.2, *RISE, 0.45]), True),
        ("fig11", curve([0.5], loss=[0.2, *RISE, 0.45]), False),  # does not fall first
        ("fig11", curve([0.5], loss=[0.3, 0.2, *RISE, *[0.3] * 8]), False),  # sinks by over half
        ("fig11", curve([0.5], loss=[0.3, 0.2, *RISE]), True),
        ("fig11", curve([0.5], loss=[0.5, 0.4, 0.3, 0.2]), False),  # does not rise
    ],
)
def test_a_run_is_like_fig_12_by_its_msr_and_like_fig_11_by_its_loss(figure, run, like):
    assert seamless_plan(run)[figure] is like
