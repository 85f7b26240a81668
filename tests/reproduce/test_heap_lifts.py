"""Single lifts from heaps, at reduced size."""

from functools import partial

import pandas as pd
import pytest

from unload.heap.lift import LiftEnv
from unload.heap.rules import RULES
from unload.reproduce import heap_lifts
from unload.support.provenance import read_provenance


@pytest.fixture(autouse=True)
def short_episodes(monkeypatch):
    monkeypatch.setattr(heap_lifts, "PHYSICS", "near")
    monkeypatch.setattr(heap_lifts, "LiftEnv", partial(LiftEnv, max_picks=4))
    monkeypatch.setattr(heap_lifts, "RULES", {name: RULES[name] for name in ("highest", "lowest")})


def test_each_rule_lifts_from_each_heap_and_is_kept(tmp_path):
    frame = heap_lifts.lifts_data(2, tmp_path, tmp_path, progress=False)
    assert frame["policy"].tolist() == ["highest"] * 2 + ["lowest"] * 2
    assert frame["heap"].tolist() == [0, 1] * 2 and (frame["lifts"] == 4).all()
    rates = frame.groupby("policy")["success_rate"].mean()
    assert rates["highest"] > rates["lowest"], "boxes at the bottom are covered"
    assert read_provenance(tmp_path / "heap", "lifts")["reduced"]
    kept = sorted((tmp_path / "heap" / "lifts").iterdir())
    written = [path.stat().st_mtime_ns for path in kept]
    again = heap_lifts.lifts_data(2, tmp_path, tmp_path, progress=False)
    pd.testing.assert_frame_equal(frame, again)
    assert len(kept) == 4 and [path.stat().st_mtime_ns for path in kept] == written


def test_too_many_heaps_are_refused(tmp_path):
    with pytest.raises(ValueError, match="heaps is 31"):
        heap_lifts.lifts_data(31, tmp_path, tmp_path)
