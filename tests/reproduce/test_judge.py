import json

import numpy as np
import pandas as pd
import pytest

from unload import evaluate, load_policy
from unload.reproduce import judge, study
from unload.reproduce.judge import read_study, study_data


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A small experiment: one run of each reward, judged on few loads."""
    folder = tmp_path_factory.mktemp("made")
    with pytest.MonkeyPatch.context() as patch:
        for module, name, value in (
            (
                study,
                "BASE",
                study.TrainConfig(batch_size=16, n_features=4, snapshots=2, log_interval=5),
            ),
            (judge, "LOADS", 3),
            (judge, "SNAPSHOT_LOADS", 2),
        ):
            patch.setattr(module, name, value)
        for _ in range(2):  # the second time nothing is trained
            study_data("rewards", folder, folder / "runs", 1, False, picks=64 * 60, seeds=1)
    return folder


def test_an_experiment_leaves_a_row_for_each_run(made):
    rows, _ = read_study("rewards", made)
    assert rows["run"].tolist() == list(study.rewards(seeds=1))
    assert set(rows["features"]) == {"noisy ranks"}
    assert rows["height_reward"].nunique() == 4
    for name in ("msr_mask", "msr_no_mask", "deadlocked", "deadlocked_training"):
        assert rows[name].between(0, 1).all()


def test_a_policy_is_judged_as_evaluate_does(made):
    rows, _ = read_study("rewards", made)
    row = rows.set_index("run").loc["noisy ranks/height_reward 0.5/seed_0"]
    policy = load_policy(made / "runs/study/rewards" / row.name / "policy.safetensors")
    assert policy.equalize
    table = evaluate(policy, 3, judge.LOADS_SEED, mask=False)
    assert row["msr_no_mask"] == pytest.approx(table["success_rate"].mean(), rel=1e-5)
    assert row["longest_deadlock"] == table["longest_deadlock"].max()


def test_the_last_snapshot_is_the_trained_policy(made):
    rows, curves = read_study("rewards", made)
    assert curves.groupby("run")["picks"].apply(list).map(len).eq(2).all()
    assert curves["picks"].max() == rows["picks"].max()
    assert np.isfinite(curves[["success_rate", "deadlocked", "msr_mask"]].to_numpy()).all()


def test_the_goal_is_reached_at_the_first_snapshot_that_reaches_it(made):
    rows, curves = read_study("rewards", made)
    for _, row in rows.iterrows():
        good = curves[(curves["run"] == row["run"]) & (curves["msr_mask"] >= judge.GOAL)]
        first = row["picks_to_goal_mask"]
        assert np.isnan(first) if good.empty else first == good["picks"].min()


def test_a_smaller_experiment_says_so(made):
    provenance = json.loads((made / "study/rewards.provenance.json").read_text())
    assert provenance["reduced"]
    assert provenance["runs"] == len(study.rewards(seeds=1))
    assert "rewards" in provenance["command"]


def test_the_recommended_agent_is_kept(tmp_path, monkeypatch):
    base = study.TrainConfig(num_envs=4, n_features=4, snapshots=1)
    monkeypatch.setattr(study, "BASE", base)
    monkeypatch.setattr(judge, "LOADS", 1)
    monkeypatch.setattr(judge, "SNAPSHOT_LOADS", 1)
    study_data("recommended", tmp_path, tmp_path / "runs", 1, False, picks=2400, seeds=1)
    policy = load_policy(tmp_path / "policies/recommended.safetensors")
    assert not policy.equalize


def test_what_is_missing_or_unknown_is_refused_by_name(tmp_path):
    with pytest.raises(
        FileNotFoundError, match=r"factorial.csv is missing.*--experiments factorial"
    ):
        read_study("factorial", tmp_path)
    with pytest.raises(ValueError, match="experiment"):
        read_study("nothing", tmp_path)
    with pytest.raises(ValueError, match="experiment"):
        study_data("nothing", tmp_path, tmp_path)


def test_curves_are_of_the_experiment(made):
    text = (made / "study/rewards_curves.csv").read_text()
    assert set(pd.read_csv(made / "study/rewards_curves.csv")["run"]) == set(study.rewards(seeds=1))
    assert "wall_time" not in text  # nothing that would differ in a second run
