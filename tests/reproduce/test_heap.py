"""The heaps, their physics and their camera, at reduced size."""

import numpy as np
import pandas as pd
import pytest

from unload.heap.boxes import Heap
from unload.heap.env import stored_heaps
from unload.heap.generate import read_heaps
from unload.reproduce import heap
from unload.support.provenance import read_provenance


@pytest.fixture
def quick_heaps(monkeypatch):
    """A generator of parts of a stored heap, which the seed chooses."""

    def make(rng: np.random.Generator, scale: float, friction: float) -> Heap:
        assert (scale, friction) == (1.0, 0.5)
        whole = stored_heaps("train")[0]
        return whole.only(np.sort(rng.choice(len(whole), 5, replace=False)))

    monkeypatch.setattr(heap, "settled_heap", make)


def test_the_shipped_heaps_are_what_the_generator_makes():
    """Of number 60, boxes were still leaving in the last round of settling."""
    lists = heap.heap_job(heap.SEEDS["train"], 60)[1]()
    assert stored_heaps("train")[60].positions.tolist() == lists["positions"]


def test_heaps_are_those_of_their_seeds(quick_heaps, tmp_path):
    few, more = tmp_path / "few", tmp_path / "more"
    heap.heaps_data({"train": 2, "test": 1}, few, tmp_path, progress=False)
    heap.heaps_data({"train": 3, "test": 2}, more, tmp_path / "again", progress=False)
    for split, count in (("train", 2), ("test", 1)):
        first = read_heaps(split, few / "heaps.npz")
        second = read_heaps(split, more / "heaps.npz")
        assert len(first) == count and len(second) == count + 1
        for one, other in zip(first, second):
            assert one.positions.tobytes() == other.positions.tobytes()
    train, test = (read_heaps(split, more / "heaps.npz")[0] for split in ("train", "test"))
    assert not np.array_equal(train.positions, test.positions)
    provenance = read_provenance(few, "heaps")
    assert provenance["reduced"] and provenance["settings"]["heaps"] == {"train": 2, "test": 1}


def test_the_stored_heaps_are_enough_small_and_apart():
    train, test = stored_heaps("train"), stored_heaps("test")
    assert len(train) >= 70 and len(test) >= 30
    starts = {each.positions.tobytes() for each in (*train, *test)}
    assert len(starts) == len(train) + len(test)
    assert (heap.files.DATA / "heaps.npz").stat().st_size < 2e6


@pytest.mark.slow
def test_agreement_asks_every_physics_the_same_picks(tmp_path):
    frame = heap.agreement_data(1, tmp_path, tmp_path, progress=False)
    assert frame["pick"].tolist() == [0] * 3
    assert frame["physics"].tolist() == list(heap.PHYSICS)
    assert (frame["cpu_ms"] > 0).all() and frame["moved"].between(-0.2, 1).all()
    again = heap.agreement_data(1, tmp_path / "again", tmp_path / "again", progress=False)
    columns = ["unloaded", "falls", "came", "moved"]
    pd.testing.assert_frame_equal(frame[columns], again[columns])


def test_camera_errors_are_those_of_hidden_parts(tmp_path, monkeypatch):
    monkeypatch.setattr(heap, "stored_heaps", lambda split: stored_heaps(split)[:2])
    frame = heap.camera_data("test", tmp_path, tmp_path, progress=False)
    assert set(frame["heap"]) == {0, 1}
    share = len(frame) / frame.groupby("heap")["boxes"].first().sum()
    assert 0.3 < share < 0.8, "some boxes are hidden, not most of them"
    assert 0.02 < frame["centre_error"].median() < 0.3
    assert frame["extent_error"].median() < 0, "blocks of visible points are too small"
    shown = frame["pixels"] > frame["pixels"].median()
    errors = frame["centre_error"].groupby(shown).median()
    assert errors[True] < errors[False], "what shows more is known better"
