from dataclasses import replace

from studies import paths
from studies.falls import long
from studies.grid import read_policies
from studies.paper.training import PAPER
from studies.results import read_provenance


def test_runs_are_traced(tmp_path, monkeypatch):
    monkeypatch.setattr(long, "training_fingerprint", lambda: "f")
    monkeypatch.setattr(long, "CONFIG", replace(long.CONFIG, picks=64_000))
    long.trace_data(tmp_path, tmp_path / "runs", 1)
    table = long.read_long_trace(tmp_path)
    assert list(table["seed"]) == [20, 20, 21, 21]
    assert list(table["picks"]) == [31_936, 63_936] * 2
    assert read_provenance(tmp_path / "falls", "long_trace")["settings"]["picks"] == 64_000


def test_the_published_trace_is_of_the_published_runs():
    """A trace only looks: the success rates at its points are those of the same run."""
    trace = long.read_long_trace()
    for seed, points in trace.groupby("seed"):
        assert points["picks"].is_monotonic_increasing and seed in long.TRACED_SEEDS
        assert points["picks"].iloc[-1] > 0.99 * long.CONFIG.picks
        assert (points["wrong_without_place"] == 0).mean() > 0.99


def test_policies_and_networks_are_judged_alike(tmp_path, monkeypatch):
    """One published policy and one network without training, in one container each."""
    monkeypatch.setattr(long, "UNTRAINED", 1)
    name = "paper_mask/seed_0"
    policy = read_policies(paths.DATA / "falls/paper.safetensors")[name]
    monkeypatch.setattr(
        long, "read_policies", lambda path: {name: policy} if path.stem == "paper" else {}
    )
    monkeypatch.setattr(long, "training_fingerprint", lambda: "f")
    monkeypatch.setattr(long, "LOADS", {"episodes": 1, "seed": 0})
    long.published_data(tmp_path, tmp_path / "runs", n_jobs=1)
    judged = long.read_published(tmp_path)
    kept = set((tmp_path / "runs/published").iterdir())
    policy.network.scorer.weight.data[0, 0] += 1  # another network of the same name
    long.published_data(tmp_path, tmp_path / "runs", n_jobs=1)
    again = set((tmp_path / "runs/published").iterdir())
    assert kept < again and len(again) == len(kept) + 1
    assert list(judged["cell"]) == ["paper_mask", "untrained"]
    policy, network = judged.itertuples()
    assert policy.judged_place == 1 > policy.judged_as_is
    assert network.judged_as_is < 0.9


def test_the_published_table_holds_every_policy():
    table = long.read_published()
    planned = {cell: len(each.seeds) for cell, each in PAPER.cells.items()}
    counts = table.groupby("cell").size()
    assert {cell: counts[cell] for cell in planned} == planned
    assert counts["untrained"] == long.UNTRAINED
