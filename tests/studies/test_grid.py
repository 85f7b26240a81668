from dataclasses import replace

import numpy as np
import pytest

from studies import grid
from studies.changes import shuffled
from studies.results import read_provenance
from unload.agent.config import TrainConfig

CONFIG = TrainConfig(
    picks=640, num_envs=8, batch_size=64, n_features=4, log_interval=20, replay_size=512
)


@pytest.fixture
def small():
    cells = {
        "plain": grid.Cell(CONFIG, (0, 1)),
        "averaged_mask": grid.Cell(replace(CONFIG, mask=True, ties="average"), (3,)),
        "shuffled": grid.Cell(CONFIG, (0,), shuffled),
    }
    return grid.Grid("some/small", "make small", cells)


@pytest.fixture
def trained(small, tmp_path, monkeypatch):
    monkeypatch.setattr(grid, "training_fingerprint", lambda networks: "f")
    grid.train_grid(small, None, None, tmp_path, tmp_path / "runs", n_jobs=1)
    return tmp_path


def test_a_grid_is_read_as_it_was_trained(small, trained):
    curves = grid.read_grid(small, trained)
    names = curves[["cell", "seed"]].drop_duplicates().itertuples(index=False)
    assert [tuple(name) for name in names] == [
        ("plain", 0), ("plain", 1), ("averaged_mask", 3), ("shuffled", 0)
    ]  # fmt: skip
    assert (curves.groupby(["cell", "seed"])["picks"].max() == 640).all()
    plain, changed = (curves[(curves["cell"] == c) & (curves["seed"] == 0)] for c in small.cells
                      if c != "averaged_mask")  # fmt: skip
    assert not np.array_equal(plain["loss"], changed["loss"])


def test_policies_of_a_grid_are_told_by_their_runs(small, trained):
    policies = grid.read_policies(trained / "some/small.safetensors")
    assert list(policies) == list(small.configs())
    assert policies["averaged_mask/seed_3"].ties == "average"
    first, second = (policies[f"plain/seed_{seed}"].network.state_dict() for seed in (0, 1))
    assert all(not np.array_equal(first[name], second[name]) for name in first)


def test_its_provenance_says_what_is_planned_and_done(small, trained):
    provenance = read_provenance(trained / "some", "small")
    assert (provenance["runs"], provenance["planned"], provenance["reduced"]) == (4, 4, False)
    assert provenance["settings"]["averaged_mask"]["mask"] is True


def test_published_runs_are_not_replaced_by_fewer(small, trained):
    before = (trained / "some/small_loss.csv").read_bytes()
    with pytest.raises(
        ValueError, match="holds 2 finished runs; expected at least as many as the 4"
    ):
        grid.train_grid(small, ["plain"], None, trained, trained / "other", 1)
    assert (trained / "some/small_loss.csv").read_bytes() == before


def test_a_shorter_grid_is_published_elsewhere(small, trained):
    before = (trained / "some/small_loss.csv").read_bytes()
    grid.train_grid(small, ["plain"], 320, trained, trained / "runs", 1)
    assert (trained / "some/small_loss.csv").read_bytes() == before
    assert read_provenance(trained / "reduced/some", "small")["reduced"]
