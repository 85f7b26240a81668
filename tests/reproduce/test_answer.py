import numpy as np
import pandas as pd
import pytest

from unload import load_policy
from unload.reproduce import answer, training
from unload.reproduce.fingerprint import training_fingerprint
from unload.reproduce.verdict import end_msr
from unload.support import files
from unload.support.provenance import read_provenance

PICKS = 64_000  # two episodes of all environments


@pytest.fixture(scope="module")
def published(tmp_path_factory):
    """The data folder after one short run of one cell."""
    folder = tmp_path_factory.mktemp("data")
    for _ in range(2):  # the second time, nothing is trained
        answer.answer_data(
            ["paper_mask"], [0], PICKS, folder, folder / "runs", n_jobs=1, progress=False
        )
    return folder


def test_a_run_is_published_with_its_weights_and_provenance(published):
    place = published / "answer" / "paper_mask"
    assert {path.name for path in place.iterdir()} == {
        "seed_0.csv", "seed_0.safetensors", "seed_0.provenance.json"
    }  # fmt: skip
    provenance = read_provenance(place, "seed_0")
    assert provenance["reduced"] and provenance["settings"]["mask"]
    assert provenance["settings"]["picks"] == PICKS and provenance["runs"] == 1
    assert "--cells paper_mask" in provenance["command"]
    assert load_policy(place / "seed_0.safetensors").equalize
    assert provenance["fingerprint"] == training_fingerprint()
    curve = pd.read_csv(place / "seed_0.csv")
    assert curve["picks"].tolist() == [32_000, 64_000]
    assert curve["success_rate"].between(0.2, 0.9).all()


def test_runs_of_the_training_are_not_made_again(tmp_path, monkeypatch):
    training.training_data(PICKS, [0], tmp_path, tmp_path / "runs", 1, False)
    monkeypatch.setattr("unload.agent.training.Training.step", None)  # nothing is trained
    cell = answer.AS_TRAINED
    answer.answer_data([cell], [0], PICKS, tmp_path, tmp_path / "runs", 1, False)
    ((_, _, curve),) = answer.read_answer(tmp_path)
    expected = pd.read_csv(tmp_path / "training_curves.csv")[answer.COLUMNS]
    pd.testing.assert_frame_equal(curve, expected, rtol=1e-4)
    assert len(curve) == 2  # of ten points


def test_runs_are_kept_under_the_fingerprint_of_their_training(published):
    run = published / "runs/answer" / training_fingerprint() / "paper_mask/seed_0"
    assert (run / "policy.safetensors").is_file()


def test_a_run_is_published_at_its_end_and_whatever_others_do(tmp_path, monkeypatch):
    def run_all(configs, *args, **kwargs):
        (name,) = configs
        published.append(sorted(path.name for path in tmp_path.rglob("answer/*/seed_?.csv")))
        if name.endswith("seed_1"):
            raise RuntimeError(f"runs failed:\n{name} broke")
        return train_all(configs, *args, **kwargs)

    published, train_all = [], answer.run_all
    monkeypatch.setattr(answer, "run_all", run_all)
    with pytest.raises(RuntimeError, match="^runs failed:\npaper_mask/seed_1 broke$"):
        answer.answer_data(
            ["paper_mask"], range(3), PICKS // 2, tmp_path, tmp_path / "runs", 1, progress=False
        )
    assert published == [[], ["seed_0.csv"], ["seed_0.csv"]]
    assert [seed for _, seed, _ in answer.read_answer(tmp_path)] == [0, 2]


def test_published_runs_are_read_back(published):
    ((cell, seed, curve),) = answer.read_answer(published)
    assert (cell, seed, list(curve.columns)) == ("paper_mask", 0, answer.COLUMNS)


def test_the_cells_are_those_of_the_plan():
    plan = (files.DATA / "answer" / "PLAN.md").read_text()
    assert "| 256 | on | | 0–9 |" in plan and "| 2048 | off | | 0–7 |" in plan
    for cell, config in answer.CELLS.items():
        assert config.picks == 20_000_000
        assert config.mask == (not cell.endswith("_no_mask"))
        assert config.batch_size == (2048 if "2048" in cell else 256)
    assert len(answer.seeds_of("paper_no_mask")) == 10
    assert len(answer.seeds_of("paper_b2048_mask")) == 8
    assert len(answer.seeds_of("memory_23_mask")) == 5


def test_unknown_cells_are_refused(tmp_path):
    with pytest.raises(ValueError, match="cells is 'tea'; expected one of 'paper_no_mask'"):
        answer.answer_data(["tea"], folder=tmp_path, runs_dir=tmp_path)
    assert not list(tmp_path.iterdir())


def test_published_are_the_runs_of_the_plan_and_whole():
    runs = list(answer.read_answer())
    planned = [(cell, seed) for cell in answer.CELLS for seed in answer.seeds_of(cell)]
    assert [run[:2] for run in runs] == planned
    for _, _, curve in runs:
        assert curve["picks"].iloc[-1] == 20_000_000
        assert 0.2 < end_msr(curve) <= 1


def test_recorded_times_of_the_papers_cells():
    small, large = answer.wall_minutes(256), answer.wall_minutes(2048)
    assert len(small) == 20 and len(large) == 16
    assert 1 < np.median(small) < np.median(large) < 60
    assert answer.wall_minutes(64) == []


def test_published_runs_of_the_training_are_those_of_its_cell():
    runs = {seed: curve for cell, seed, curve in answer.paper_runs() if cell == answer.AS_TRAINED}
    curves = pd.read_csv(files.DATA / "training_curves.csv").groupby("seed")
    assert list(curves.groups) == list(training.SEEDS)
    for seed, curve in curves:
        pd.testing.assert_frame_equal(
            curve[answer.COLUMNS].reset_index(drop=True), runs[seed], rtol=1e-4, check_dtype=False
        )
