"""Recording and learning, at reduced size: episodes of three picks of boxes nearby."""

from functools import partial

import numpy as np
import pytest

from unload.heap.env import HeapEnv
from unload.heap.learning import load_network, save_network
from unload.heap.network import HeapNetwork
from unload.reproduce import heap_learning
from unload.reproduce.heap_learning import Variant, network_path
from unload.support.provenance import read_provenance


@pytest.fixture(autouse=True)
def short_episodes(monkeypatch):
    monkeypatch.setattr(heap_learning, "MAX_PICKS", 3)
    monkeypatch.setattr(heap_learning, "HeapEnv", partial(HeapEnv, max_picks=3))
    variants = {"learned": Variant(n_features=8), "γ = 0.5": Variant("own", 0.5, 8)}
    monkeypatch.setattr(heap_learning, "VARIANTS", variants)


@pytest.mark.slow
def test_both_rounds_are_recorded_and_learned_and_kept(tmp_path):
    arguments = {"picks": 12, "physics": "near", "seeds": 2, "steps": 2, "progress": False}
    heap_learning.learning_data(folder=tmp_path / "data", runs_dir=tmp_path, **arguments)
    assert len(heap_learning.read_picks(tmp_path, ["round0", "round1"])) == 12
    assert len(heap_learning.read_picks(tmp_path, ["round0"])) == 6
    episodes = sorted((tmp_path / "heap" / "picks").rglob("*.npz"))
    written = [path.stat().st_mtime_ns for path in episodes]
    kept = sorted((tmp_path / "data" / "heap" / "networks").glob("*.safetensors"))
    assert len(episodes) == 4 and len(kept) == 2
    assert {load_network(path).kind for path in kept} == {"fates"}
    provenance = read_provenance(tmp_path / "data" / "heap", "networks")
    assert provenance["reduced"] and provenance["runs"] == 4 + 2 + 4
    assert provenance["wall_time_s"] > 0
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
    picks = heap_learning.read_picks(tmp_path / "all", ["round0"])
    assert len(picks) == 6 and np.isfinite(picks.observations).all()


def test_missing_rounds_are_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="heap-learning makes it"):
        heap_learning.record_picks(3, 1, "near", tmp_path, progress=False)
    with pytest.raises(FileNotFoundError, match="heap-learning records them"):
        heap_learning.read_picks(tmp_path, ["round0"])
    with pytest.raises(ValueError, match="round_number is 2"):
        heap_learning.record_picks(3, 2, "near", tmp_path, progress=False)
    with pytest.raises(ValueError, match="kind is 'best'"):
        heap_learning.learn(0, 1, [Variant("best")], tmp_path)


def test_results_with_other_settings_are_not_mixed(tmp_path):
    """Files are named by numbers, so that only their settings tell what they are."""
    heap_learning.record_picks(3, 0, "near", tmp_path, progress=False)
    with pytest.raises(ValueError, match="'physics': 'near'.*expected.*'physics': 'coarse'"):
        heap_learning.record_picks(3, 0, "coarse", tmp_path, progress=False)
    heap_learning.learn(0, 1, [Variant("linear")], tmp_path, steps=2)
    with pytest.raises(ValueError, match="'steps': 2.*expected.*'steps': 3"):
        heap_learning.learn(0, 1, [Variant("linear")], tmp_path, steps=3)
    for weights in (1, 2):
        network = network_path(0, heap_learning.EXPLORER, 0, tmp_path)
        save_network(HeapNetwork(n_features=weights), network)
        if weights == 1:
            heap_learning.record_picks(3, 1, "near", tmp_path, progress=False)
    with pytest.raises(ValueError, match="expected.*'explorers'"):
        heap_learning.record_picks(3, 1, "near", tmp_path, progress=False)
    heap_learning.record_picks(6, 0, "near", tmp_path, progress=False)
    with pytest.raises(ValueError, match="'episodes': 1.*expected.*'episodes': 2"):
        heap_learning.learn(0, 2, [Variant("linear")], tmp_path, steps=2)
