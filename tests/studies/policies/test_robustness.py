"""Policies with every box simulated."""

from functools import partial

import numpy as np
import pandas as pd
import pytest

from studies.policies import robustness
from studies.policies.robustness import FRONT_WALLS, front_walls
from studies.results import read_provenance
from tests.agent.networks import lowest
from unload import policies, task
from unload.agent.evaluation import evaluate
from unload.env.observation import nearest
from unload.load.boxes import Load
from unload.load.substacks import stack_load
from unload.physics.bullet import World


def two_walls(rng: np.random.Generator) -> Load:
    return front_walls(stack_load(rng), 2)


def piles(rng: np.random.Generator) -> Load:
    """140 piles of two cubes each."""
    x, y, z = np.meshgrid(0.5 * np.arange(14) + 0.25, 0.25 * np.arange(10) + 0.125, (0.1, 0.3))
    positions = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    labels = np.zeros(len(positions), dtype=int)
    return Load(positions, np.full((len(positions), 3), 0.2), labels, labels)


def test_play_agrees_with_evaluate():
    seed = np.random.SeedSequence(4).generate_state(1).tolist()[0]
    row = robustness.play(policies.random, "keep", seed, 4, two_walls)
    settings = {"physics": "full", "after_pick": "keep", "max_picks": 4, "stack": two_walls}
    assert row["success_rate"] == evaluate(policies.random, 1, 4, **settings)["success_rate"][0]


@pytest.mark.parametrize(
    ("policy", "distance", "free", "jammed"),
    [
        (policies.highest, 0.4, 1.0, 0.0),
        (policies.highest, 0.1, 1.0, 1.0),
        (lowest, 0.1, 0.0, 0.0),
        (lowest, 0.4, 0.0, 0.0),
    ],
)
def test_only_free_boxes_that_fail_are_jammed(monkeypatch, policy, distance, free, jammed):
    monkeypatch.setattr(World, "pull", lambda world, body: distance)
    row = robustness.play(policy, "restore", 0, 20, piles)
    assert row["free"] == free and row["jammed"] == jammed
    assert row["success_rate"] == (distance > 0.2)


def test_a_stopped_run_goes_on(tmp_path, monkeypatch):
    monkeypatch.setattr(robustness, "PLAYED", (("highest", "keep"), ("highest", "restore")))
    monkeypatch.setattr(robustness, "EPISODES", 2)
    monkeypatch.setattr(robustness, "PICKS", 2)
    small = partial(robustness.play, stack=lambda rng: front_walls(stack_load(rng), 1))
    monkeypatch.setattr(robustness, "play", small)
    robustness.robustness_data(tmp_path, tmp_path / "runs")
    written = (tmp_path / "policies/robustness.csv").read_text()
    table = pd.read_csv(tmp_path / "policies/robustness.csv")
    assert table["after_pick"].tolist() == 2 * ["keep"] + 2 * ["restore"]
    assert read_provenance(tmp_path / "policies", "robustness")["settings"]["episodes"] == 2
    monkeypatch.setattr(robustness, "ContainerEnv", lambda *_, **__: pytest.fail("played again"))
    robustness.robustness_data(tmp_path, tmp_path / "runs")
    assert (tmp_path / "policies/robustness.csv").read_text() == written
    other = partial(robustness.play, stack=lambda rng: front_walls(stack_load(rng), 2))
    monkeypatch.setattr(robustness, "play", other)
    with pytest.raises(pytest.fail.Exception, match="played again"):
        robustness.robustness_data(tmp_path, tmp_path / "runs")


def test_front_walls_keep_their_place(full_load):
    front, kept = front_walls(full_load, 3), full_load.walls >= 9
    for name in ("positions", "sizes", "packages", "walls"):
        assert (getattr(front, name) == getattr(full_load, name)[kept]).all()
    assert (front_walls(front, 2).positions == front_walls(full_load, 2).positions).all()


def test_the_boxes_of_100_picks_are_in_front_of_the_spare_wall(rng):
    for _ in range(50):
        load = stack_load(rng)
        seen = nearest(load.positions, task.N_VISIBLE + robustness.PICKS)
        assert load.walls[seen].min() > 12 - FRONT_WALLS
