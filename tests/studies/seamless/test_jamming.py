"""Jams in a training run, and another weight of z."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from studies.falls.laboratory import CONFIG
from studies.seamless.jamming import jam, neighbours, uniform, weigh
from studies.seamless.jams import place
from unload import task
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
