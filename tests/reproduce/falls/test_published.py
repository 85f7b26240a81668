import pytest

from unload.reproduce.falls import published
from unload.reproduce.paper.grids import PAPER


@pytest.fixture
def judged(tmp_path, monkeypatch):
    """One published policy and one network without training, in one container each."""
    monkeypatch.setattr(published, "UNTRAINED", 1)
    monkeypatch.setattr(
        published, "_names", lambda grid, folder: ["paper_mask/seed_0"] if grid is PAPER else []
    )
    monkeypatch.setattr(published, "training_fingerprint", lambda: "f")
    files = published.files.DATA / "falls"
    (tmp_path / "falls").mkdir()
    (tmp_path / "falls/paper.safetensors").symlink_to(files / "paper.safetensors")
    published.published_data(
        {"episodes": 1, "seed": 0}, tmp_path, tmp_path / "runs", n_jobs=1, progress=False
    )
    return published.read_published(tmp_path)


def test_policies_and_networks_are_judged_alike(judged):
    assert list(judged["cell"]) == ["paper_mask", "untrained"]
    policy, network = judged.itertuples()
    assert policy.judged_place == 1 and policy.slope_z > 1
    assert network.judged_as_is < 0.9


def test_the_published_table_holds_every_policy():
    table = published.read_published()
    planned = {cell: len(each.seeds) for cell, each in PAPER.cells.items()}
    counts = table.groupby("cell").size()
    assert {cell: counts[cell] for cell in planned} == planned
    assert counts["untrained"] == published.UNTRAINED
