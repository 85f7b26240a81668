"""Finished runs, measured."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from unload import TrainConfig, evaluate, load_policy, train
from unload.reproduce import measure
from unload.reproduce.measure import measure_run

CONFIG = TrainConfig(picks=64 * 60, batch_size=16, n_features=4, snapshots=3, log_interval=5)


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """The folder, the row and the curve of a small run, measured on few loads."""
    folder = tmp_path_factory.mktemp("run")
    train(CONFIG, folder, progress=False)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(measure, "POLICY_LOADS", 3)
        patch.setattr(measure, "SNAPSHOT_LOADS", 2)
        return folder, *measure_run(CONFIG, folder)


def test_a_policy_is_measured_as_evaluate_does(measured):
    folder, row, _ = measured
    policy = load_policy(folder / "policy.safetensors")
    assert policy.equalize
    for name, mask in (("mask", True), ("no_mask", False)):
        table = evaluate(policy, 3, measure.LOADS_SEED, mask=mask)
        assert row[f"msr_{name}"] == pytest.approx(table["success_rate"].mean(), rel=1e-5)
    assert row["deadlocked"] == pytest.approx(table["deadlocked"].mean(), rel=1e-5)
    assert row["longest_deadlock"] == table["longest_deadlock"].max()


def test_the_last_snapshot_is_the_trained_policy(measured):
    folder, row, curve = measured
    assert curve["picks"].tolist() == [64 * 20, 64 * 40, 64 * 60] and row["picks"] == 64 * 60
    policy = load_policy(folder / "policy.safetensors")
    table = evaluate(policy, 2, measure.LOADS_SEED, mask=False)
    assert curve["msr_no_mask"].iloc[-1] == table["success_rate"].mean()


def test_a_snapshot_has_the_means_of_the_training_since_the_last_one(measured):
    folder, row, curve = measured
    training = train(CONFIG, folder, progress=False).curve
    assert len(training) == 12
    for name in ("success_rate", "deadlocked", "loss"):
        means = training[name].to_numpy().reshape(3, 4).mean(axis=1)
        assert np.allclose(curve[name], means)
    assert row["deadlocked_overall"] == pytest.approx(training["deadlocked"].mean())
    assert row["msr_training"] == training["success_rate"].iloc[-1]  # the last tenth is one point


@pytest.mark.parametrize("goal", [0.0, 2.0])
def test_the_goal_is_reached_at_the_first_snapshot_that_reaches_it(measured, monkeypatch, goal):
    folder, *_ = measured
    monkeypatch.setattr(measure, "GOAL", goal)
    monkeypatch.setattr(measure, "POLICY_LOADS", 1)
    monkeypatch.setattr(measure, "SNAPSHOT_LOADS", 1)
    row, curve = measure_run(CONFIG, folder)
    for name in ("mask", "no_mask"):
        first = row[f"picks_to_goal_{name}"]
        assert first == curve["picks"].min() if goal == 0 else np.isnan(first)


def test_a_damaged_run_or_another_one_is_refused(measured, tmp_path):
    shutil.copytree(measured[0], tmp_path, dirs_exist_ok=True)
    with pytest.raises(ValueError, match="another configuration: seed"):
        measure_run(replace(CONFIG, seed=1), tmp_path)
    curve = tmp_path / "curve.csv"
    curve.write_text(curve.read_text().replace("1", "2", 1))
    with pytest.raises(ValueError, match="curve.csv"):
        measure_run(CONFIG, tmp_path)
