import pandas as pd

from unload.reproduce.falls import long
from unload.support.provenance import read_provenance


def test_a_shorter_trace_is_written_beside_the_published_one(tmp_path, monkeypatch):
    monkeypatch.setattr(long, "training_fingerprint", lambda: "f")
    long.trace_data(64_000, tmp_path, tmp_path / "runs", 1, progress=False)
    folder = tmp_path / "reduced" / "falls"
    table = pd.read_csv(folder / "long_trace.csv")
    assert list(table["seed"]) == [20, 20, 21, 21]
    assert list(table["picks"]) == [31_936, 63_936] * 2
    assert read_provenance(folder, "long_trace")["reduced"]


def test_the_published_trace_is_of_the_published_runs():
    """A trace only looks: the success rates at its points are those of the same run."""
    trace = long.read_long_trace()
    for seed, points in trace.groupby("seed"):
        assert points["picks"].is_monotonic_increasing and seed in long.TRACED_SEEDS
        assert points["picks"].iloc[-1] > 0.99 * long.CONFIG.picks
        assert (points["wrong_without_place"] == 0).mean() > 0.99


def test_long_runs_have_seeds_that_no_plan_had_before():
    assert all(min(cell.seeds) >= 20 for cell in long.LONG.cells.values())
