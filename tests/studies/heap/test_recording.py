"""The heaps, recording and learning, at reduced size: episodes of three picks."""

import numpy as np
import pytest

from studies.heap import recording
from studies.heap.boxes import Heap
from studies.heap.env import stored_heaps
from studies.heap.generate import read_heaps
from studies.heap.learning import load_networks
from studies.heap.recording import FULL, exploring, heap_job, make_heaps, make_networks
from studies.provenance import read_provenance


@pytest.fixture
def quick_heaps(monkeypatch):
    """A generator of parts of a stored heap, which the seed chooses."""

    def make(rng: np.random.Generator) -> Heap:
        whole = stored_heaps("train")[0]
        return whole.only(np.sort(rng.choice(len(whole), 5, replace=False)))

    monkeypatch.setattr(recording, "settled_heap", make)


def test_the_shipped_heaps_are_what_the_generator_makes():
    """Of number 60, boxes were still leaving in the last round of settling."""
    lists = heap_job(recording.SEEDS["train"], 60)[1]()
    assert stored_heaps("train")[60].positions.tolist() == lists["positions"]


def test_heaps_are_those_of_their_seeds(quick_heaps, tmp_path):
    few, more = tmp_path / "few", tmp_path / "more"
    make_heaps(FULL._replace(train=2, test=1), few, tmp_path)
    make_heaps(FULL._replace(train=3, test=2), more, tmp_path / "again")
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


def test_exploring_picks_half_at_random_and_half_as_its_favourite(rng):
    observations = np.ones((1, 96, 13))
    masks = np.ones((1, 96))

    def favourite(observations, masks, rng):
        return np.array([5])

    policy = exploring(rng, favourite)
    rows = np.array([policy(observations, masks, rng)[0] for _ in range(400)])
    assert 0.4 < (rows == 5).mean() < 0.6
    assert len(np.unique(rows)) > 60


def test_both_rounds_are_recorded_and_learned_and_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(recording, "MAX_PICKS", 3)
    monkeypatch.setattr(recording, "PHYSICS", "near")
    learned, explorers = [], []
    fit, policy = recording.fit, recording.Learned
    monkeypatch.setattr(
        recording, "fit", lambda picks, *how: learned.append(picks) or fit(picks, *how)
    )
    monkeypatch.setattr(
        recording,
        "Learned",
        lambda networks, weight: explorers.append(weight) or policy(networks, weight),
    )
    size = FULL._replace(picks=12, networks=2, steps=2)
    make_networks(size, tmp_path / "data", tmp_path)
    assert [len(picks) for picks in learned] == [6, 6, 12, 12], "of both rounds in the second"
    assert len(explorers) == 2 and set(explorers) <= set(recording.WEIGHTS)
    picks = learned[-1]
    assert np.isfinite(picks.observations).all() and picks.unloaded.sum() > 0
    came = picks.fates[np.arange(12), picks.actions] & 1
    assert (came <= picks.unloaded).all(), "fates are those of the picks"
    published = tmp_path / "data" / "heap" / "networks.safetensors"
    assert len(load_networks(published)) == 2
    provenance = read_provenance(tmp_path / "data" / "heap", "networks")
    assert provenance["reduced"] and provenance["runs"] == 4 + 4
    written = published.read_bytes()
    kept = {path: path.stat().st_mtime_ns for path in (tmp_path / "heap").rglob("*.*")}
    make_networks(size, tmp_path / "data", tmp_path)
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "heap").rglob("*.*")} == kept
    assert published.read_bytes() == written and len(learned) == 4
    make_networks(size, tmp_path / "again", tmp_path / "again")
    assert (tmp_path / "again" / "heap" / "networks.safetensors").read_bytes() == written
    make_networks(size._replace(steps=3), tmp_path / "data", tmp_path)
    assert len(learned) == 12 and published.read_bytes() != written, "other settings, other files"
    assert len(list((tmp_path / "heap" / "picks").glob("*.npz"))) == 6, "other explorers, too"
