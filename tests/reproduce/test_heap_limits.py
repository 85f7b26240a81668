"""What limits the learned policy, at reduced size."""

from functools import partial

import numpy as np
import pytest

from unload.heap.env import HeapEnv
from unload.reproduce import heap_learning, heap_limits
from unload.reproduce.heap_learning import Variant
from unload.support.provenance import read_provenance


@pytest.fixture
def recorded(tmp_path, monkeypatch):
    """One short episode of each of the first four heaps; two of them are held out."""
    monkeypatch.setattr(heap_learning, "MAX_PICKS", 3)
    monkeypatch.setattr(heap_learning, "HeapEnv", partial(HeapEnv, max_picks=3))
    monkeypatch.setattr(heap_limits, "HELD_OUT", range(2, 4))
    variants = {"learned": Variant(n_features=8), "own row": Variant("own", n_features=8)}
    monkeypatch.setattr(heap_limits, "VARIANTS", variants)
    monkeypatch.setattr(heap_limits, "OTHERS", ["own row"])
    heap_learning.record_picks(12, 0, "near", tmp_path, progress=False)
    return tmp_path


def test_networks_learn_from_some_heaps_and_are_judged_on_others(recorded, monkeypatch):
    learned_from = []
    learn = heap_limits.fit
    monkeypatch.setattr(
        heap_limits,
        "fit",
        lambda picks, *a, **k: learned_from.append(picks) or learn(picks, *a, **k),
    )
    arguments = {
        "heaps": (1, 2), "seeds": 1, "steps": 2, "picks": 3, "rounds": 1,
        "folder": recorded, "runs_dir": recorded, "progress": False,
    }  # fmt: skip
    limits, disturbed = heap_limits.limits_data(**arguments)
    assert limits["picks"].tolist() == [3, 6, 6] == [len(picks) for picks in learned_from]
    assert limits["variant"].tolist() == ["learned", "learned", "own row"]
    assert limits["correlation"].between(-1, 1).all()
    assert disturbed["distance"].tolist() == [0.0, 0.001, 0.005] * 3
    assert (disturbed[["boxes", "falls"]] >= 0).all(axis=None)
    assert read_provenance(recorded / "heap", "limits")["reduced"]
    again, _ = heap_limits.limits_data(**arguments)
    assert again.equals(limits) and len(learned_from) == 3, "kept"


def test_the_heaps_that_are_held_out_cannot_be_learned_from(recorded):
    with pytest.raises(ValueError, match="a number of heaps is 3; expected"):
        heap_limits.limits_data((3,), folder=recorded, runs_dir=recorded)


def test_picks_can_be_read_by_heap(recorded):
    some = [heap_learning.read_picks(recorded, ["round0"], [number]) for number in range(4)]
    every = heap_learning.read_picks(recorded, ["round0"])
    assert np.array_equal(every.actions, np.concatenate([each.actions for each in some]))


def test_missing_picks_name_the_command(tmp_path):
    with pytest.raises(FileNotFoundError, match="heap-learning records picks"):
        heap_limits.limits_data(folder=tmp_path, runs_dir=tmp_path)
