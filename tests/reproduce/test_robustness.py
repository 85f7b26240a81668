"""Policies with every box simulated."""

import numpy as np
import pandas as pd
import pytest

from unload import policies
from unload.agent.evaluation import evaluate
from unload.load.boxes import Load
from unload.load.substacks import front_walls, stack_load
from unload.physics.bullet import World
from unload.reproduce import robustness
from unload.support import files
from unload.support.provenance import read_provenance


def two_walls(rng: np.random.Generator) -> Load:
    return front_walls(stack_load(rng), 2)


def piles(rng: np.random.Generator) -> Load:
    """140 piles of two cubes each."""
    x, y, z = np.meshgrid(0.5 * np.arange(14) + 0.25, 0.25 * np.arange(10) + 0.125, (0.1, 0.3))
    positions = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    labels = np.zeros(len(positions), dtype=int)
    return Load(positions, np.full((len(positions), 3), 0.2), labels, labels)


def lowest(observations, masks, rng):
    return np.where(masks, observations[..., 2], np.inf).argmin(axis=1)


@pytest.fixture
def quick(monkeypatch, tmp_path):
    """``quick(names)``: two episodes of two picks in small loads, kept in ``tmp_path``."""
    monkeypatch.setattr(robustness, "front_load", lambda rng: front_walls(stack_load(rng), 1))
    monkeypatch.setattr(robustness, "RESTORED", ("highest",))
    (tmp_path / "data").mkdir()
    (tmp_path / "data/policies").symlink_to(files.DATA / "policies")

    def run(*names: str) -> pd.DataFrame:
        return robustness.robustness_data(
            names, 2, 2, tmp_path / "data", tmp_path / "runs", progress=False
        )

    return run


# --- one container ------------------------------------------------------------------


@pytest.mark.parametrize("mask", [True, False])
def test_play_agrees_with_evaluate(mask):
    seed = np.random.SeedSequence(4).generate_state(1).tolist()[0]
    row = robustness.play(policies.random, "keep", seed, 4, mask, two_walls)
    settings = {"physics": "full", "after_pick": "keep", "max_picks": 4, "stack": two_walls}
    expected = evaluate(policies.random, 1, 4, mask=mask, **settings).iloc[0]
    assert {name: row[name] for name in expected.index} == expected.to_dict()
    assert 0 < row["median_displacement"] <= row["max_displacement"] < 1


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
    row = robustness.play(policy, "restore", 0, 20, stack=piles)
    assert row["free"] == free and row["jammed"] == jammed
    assert row["success_rate"] == (distance > 0.2)
    assert row["max_displacement"] == 0


def test_a_box_is_free_once_all_on_it_is_unloaded(monkeypatch):
    monkeypatch.setattr(World, "pull", lambda world, body: 0.4)
    row = robustness.play(policies.highest, "restore", 0, 200, stack=piles)
    assert row["unloaded"] == 200 and row["free"] == 1


def test_deadlocks_are_counted_without_a_mask(monkeypatch):
    monkeypatch.setattr(World, "pull", lambda world, body: 0.0)
    row = robustness.play(policies.nearest, "restore", 0, 10, mask=False, stack=piles)
    assert row["deadlocked"] == 0.9 and row["longest_deadlock"] == 9


def test_the_table_lifts_as_the_full_physics_that_restores():
    rows = [
        robustness.play(policies.highest, how, 3, 3, stack=two_walls)
        for how in ("table", "restore")
    ]
    assert rows[0] == rows[1]


def test_bad_settings_are_refused():
    with pytest.raises(ValueError, match="after_pick is 'forget'"):
        robustness.play(policies.random, "forget", 0)
    with pytest.raises(ValueError, match="seed is -1"):
        robustness.play(policies.random, "keep", -1)
    with pytest.raises(TypeError, match="mask is 1"):
        robustness.play(policies.random, "keep", 0, mask=1)
    with pytest.raises(ValueError, match="expected more than picks=280 items"):
        robustness.play(policies.random, "keep", 0, picks=280, stack=piles)


# --- the data -----------------------------------------------------------------------


def test_data_and_its_provenance(quick, tmp_path, monkeypatch):
    frame = quick("highest", "paper")
    both = ["highest"] * 2 + ["paper"] * 2
    assert frame["policy"].tolist() == both + both + ["highest"] * 2
    assert frame["after_pick"].tolist() == ["table"] * 4 + ["keep"] * 4 + ["restore"] * 2
    moved = frame.groupby("after_pick")["median_displacement"]
    assert (moved.max()[["table", "restore"]] == 0).all() and (moved.min()["keep"] > 0)
    written = tmp_path / "data/robustness.csv"
    pd.testing.assert_frame_equal(pd.read_csv(written), frame, check_dtype=False, rtol=1e-5)
    provenance = read_provenance(tmp_path / "data", "robustness")
    assert provenance["reduced"]
    assert provenance["command"].endswith("robustness --policies highest paper")
    assert list(provenance["settings"]["policies"]) == ["highest", "paper"]

    # What is finished is not played again, and nothing else is taken for it.
    text = written.read_text()
    monkeypatch.setattr(robustness, "play", lambda *_, **__: pytest.fail("played again"))
    quick("highest", "paper")
    assert written.read_text() == text
    monkeypatch.setattr(robustness, "SEED", 1)
    with pytest.raises(pytest.fail.Exception, match="played again"):
        quick("highest")


def test_all_policies_meet_the_same_loads(quick, monkeypatch):
    seeds = []

    def play(policy, after_pick, seed, picks, stack):
        seeds.append((after_pick, seed))
        return {"success_rate": 1.0}

    monkeypatch.setattr(robustness, "play", play)
    quick("highest", "random", "nearest")
    assert len(seeds) == 14 and len(set(seeds)) == 6
    assert seeds[:2] == seeds[2:4] == seeds[4:6]


def test_absent_and_unknown_policies_are_named(quick, tmp_path):
    (tmp_path / "data/policies").unlink()
    with pytest.raises(FileNotFoundError, match="policies/paper.safetensors is absent"):
        quick("highest", "paper")
    with pytest.raises(ValueError, match="name is 'lowest'; expected one of 'random'"):
        quick("lowest")
    assert not (tmp_path / "runs").exists()
