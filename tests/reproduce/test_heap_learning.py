"""Recording and learning, at reduced size: episodes of three picks of boxes nearby."""

from functools import partial

import numpy as np
import pytest

from unload.heap.env import HeapEnv
from unload.heap.learning import load_network
from unload.reproduce import heap_learning
from unload.support.provenance import read_provenance


@pytest.fixture(autouse=True)
def short_episodes(monkeypatch):
    monkeypatch.setattr(heap_learning, "MAX_PICKS", 3)
    monkeypatch.setattr(heap_learning, "HeapEnv", partial(HeapEnv, max_picks=3))
    monkeypatch.setattr(heap_learning, "VARIANTS", (("pairs", 0.0), ("own", 0.5)))


@pytest.mark.slow
def test_both_rounds_are_recorded_and_learned_and_kept(tmp_path):
    arguments = {"picks": 12, "physics": "near", "seeds": 2, "steps": 2, "progress": False}
    heap_learning.learning_data(folder=tmp_path / "data", runs_dir=tmp_path, **arguments)
    assert len(heap_learning.read_picks(tmp_path)) == 12
    assert len(heap_learning.read_picks(tmp_path, [0])) == 6
    episodes = sorted((tmp_path / "heap" / "picks").rglob("*.npz"))
    written = [path.stat().st_mtime_ns for path in episodes]
    kept = sorted((tmp_path / "data" / "heap" / "networks").glob("*.safetensors"))
    assert len(episodes) == 4 and len(kept) == 2
    assert {load_network(path).kind for path in kept} == {"pairs"}
    assert read_provenance(tmp_path / "data" / "heap", "networks")["reduced"]
    networks = [path.read_bytes() for path in kept]
    episodes[0].unlink()
    heap_learning.learning_data(folder=tmp_path / "data", runs_dir=tmp_path, **arguments)
    assert [path.stat().st_mtime_ns for path in episodes][1:] == written[1:], "kept"
    assert [path.read_bytes() for path in kept] == networks


def test_an_episode_is_the_same_whenever_it_is_recorded(tmp_path):
    for folder, picks in ((tmp_path / "all", 6), (tmp_path / "one", 3)):
        heap_learning.record_picks(picks, 0, "near", folder, progress=False)
    first, second = (
        (tmp_path / name / "heap/picks/round0/00000.npz").read_bytes() for name in ("all", "one")
    )
    assert first == second
    picks = heap_learning.read_picks(tmp_path / "all")
    assert len(picks) == 6 and np.isfinite(picks.observations).all()


def test_missing_rounds_are_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="heap-learning makes it"):
        heap_learning.record_picks(3, 1, "near", tmp_path, progress=False)
    with pytest.raises(FileNotFoundError, match="heap-learning records them"):
        heap_learning.read_picks(tmp_path)
    with pytest.raises(ValueError, match="round_number is 2"):
        heap_learning.record_picks(3, 2, "near", tmp_path, progress=False)
    with pytest.raises(ValueError, match="kind is 'best'"):
        heap_learning.learn(0, 1, [("best", 0.0)], tmp_path)
