"""The study's experiments: their configurations and their data."""

import json
from collections import Counter
from dataclasses import asdict

import numpy as np
import pandas as pd
import pytest

from unload import TrainConfig, load_policy
from unload.reproduce import measure, study
from unload.reproduce.fingerprint import training_fingerprint
from unload.reproduce.study import (
    BASE,
    EXPERIMENTS,
    FEATURE_SETTINGS,
    factorial,
    features_of,
    read_study,
    study_data,
)

ALLOWED = {"seed", "picks", "batch_size", "snapshots"}


@pytest.mark.parametrize("experiment", EXPERIMENTS)
def test_every_run_has_a_configuration_of_its_own(experiment):
    configs = EXPERIMENTS[experiment]()
    assert len(set(configs.values())) == len(configs)
    assert len({config.picks for config in configs.values()}) == 1
    seeds = Counter(name.rpartition("/")[0] for name in configs)
    assert len(set(seeds.values())) == 1  # as many seeds in each cell


@pytest.mark.parametrize("experiment", EXPERIMENTS)
def test_size_can_be_chosen(experiment):
    configs = EXPERIMENTS[experiment](picks=6400, seeds=1)
    assert {(config.picks, config.seed) for config in configs.values()} == {(6400, 0)}


def test_the_factorial_study_crosses_its_factors():
    cells = Counter((features_of(c), c.mask, c.epsilon_final) for c in factorial().values())
    assert len(cells) == 3 * 2 * 2
    assert set(cells.values()) == {5}


def test_the_papers_cell_is_the_papers_configuration():
    paper = asdict(TrainConfig())
    cell = asdict(factorial()["noisy ranks/no mask/floor 0/seed_0"])
    assert {name for name in paper if paper[name] != cell[name]} <= ALLOWED
    assert cell["batch_size"] == BASE.batch_size == 256


def test_the_recommended_agent_differs_from_the_paper_in_its_features_only():
    paper = asdict(TrainConfig())
    for config in EXPERIMENTS["recommended"]().values():
        differing = {name for name in paper if paper[name] != asdict(config)[name]}
        assert differing <= {"equalize", "seed", "picks", "snapshots"}
        assert not config.equalize


def test_features_have_the_name_of_their_settings():
    for name, settings in FEATURE_SETTINGS.items():
        assert features_of(TrainConfig(**settings)) == name


# --- the data -----------------------------------------------------------------------


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A small experiment: one run of each reward, measured on few loads."""
    folder = tmp_path_factory.mktemp("made")
    base = TrainConfig(batch_size=16, n_features=4, snapshots=2, log_interval=5)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study, "BASE", base)
        patch.setattr(measure, "POLICY_LOADS", 3)
        patch.setattr(measure, "SNAPSHOT_LOADS", 2)
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


def test_curves_have_a_point_for_each_snapshot(made):
    rows, curves = read_study("rewards", made)
    assert curves.groupby("run")["picks"].apply(list).map(len).eq(2).all()
    assert curves["picks"].max() == rows["picks"].max()
    assert np.isfinite(curves[["success_rate", "deadlocked", "msr_mask"]].to_numpy()).all()


def test_a_smaller_experiment_says_so(made):
    provenance = json.loads((made / "study/rewards.provenance.json").read_text())
    assert provenance["reduced"]
    assert provenance["runs"] == len(study.rewards(seeds=1))
    assert "rewards" in provenance["command"]
    assert provenance["fingerprint"] == training_fingerprint()


def test_the_recommended_agent_is_kept(tmp_path, monkeypatch):
    base = TrainConfig(num_envs=4, n_features=4, snapshots=1)
    monkeypatch.setattr(study, "BASE", base)
    monkeypatch.setattr(measure, "POLICY_LOADS", 1)
    monkeypatch.setattr(measure, "SNAPSHOT_LOADS", 1)
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
