"""The heaps, recording and learning, at reduced size: episodes of three picks."""

import numpy as np
import pytest

from studies.heap import recording
from studies.heap.boxes import Heap
from studies.heap.env import stored_heaps
from studies.heap.generate import read_heaps
from studies.heap.learning import load_networks
from studies.heap.recording import make_heaps, make_networks
from studies.results import read_provenance, unpacked


@pytest.fixture
def quick_heaps(monkeypatch):
    """A generator of parts of a stored heap, which the seed chooses."""

    def make(rng: np.random.Generator) -> Heap:
        whole = stored_heaps("train")[0]
        return whole.only(np.sort(rng.choice(len(whole), 5, replace=False)))

    monkeypatch.setattr(recording, "settled_heap", make)


def test_the_shipped_heaps_are_what_the_generator_makes():
    """Of number 60, boxes were still leaving in the last round of settling."""
    made = unpacked(recording._new_heap(recording.SEEDS["train"], 60))
    assert stored_heaps("train")[60].positions.tolist() == made["positions"].tolist()


def test_heaps_are_those_of_their_seeds(quick_heaps, tmp_path, monkeypatch):
    few, more = tmp_path / "few", tmp_path / "more"
    monkeypatch.setattr(recording, "HEAPS", {"train": 2, "test": 1})
    make_heaps(few, tmp_path)
    monkeypatch.setattr(recording, "HEAPS", {"train": 3, "test": 2})
    make_heaps(more, tmp_path / "again")
    for split, count in (("train", 2), ("test", 1)):
        first = read_heaps(split, few / "heap/heaps.npz")
        second = read_heaps(split, more / "heap/heaps.npz")
        assert len(first) == count and len(second) == count + 1
        for one, other in zip(first, second):
            assert one.positions.tobytes() == other.positions.tobytes()
    train, test = (read_heaps(split, more / "heap/heaps.npz")[0] for split in ("train", "test"))
    assert not np.array_equal(train.positions, test.positions)
    provenance = read_provenance(few / "heap", "heaps")
    assert provenance["settings"]["heaps"] == {"train": 2, "test": 1}


def test_both_rounds_are_recorded_and_learned_and_kept(tmp_path, monkeypatch):
    small = {"MAX_PICKS": 3, "PICKS": 12, "NETWORKS": 2, "STEPS": 2}
    for name, value in small.items():
        monkeypatch.setattr(recording, name, value)
    learned, explorers = [], []
    fit, policy = recording.fit, recording.Learned

    def noted_fit(picks, seed, steps):
        learned.append(picks)
        return fit(picks, seed, steps)

    def noted_policy(networks, weight):
        explorers.append(weight)
        return policy(networks, weight)

    monkeypatch.setattr(recording, "fit", noted_fit)
    monkeypatch.setattr(recording, "Learned", noted_policy)
    make_networks(tmp_path, tmp_path)
    assert [len(picks) for picks in learned] == [6, 6, 12, 12], "of both rounds in the second"
    assert len(explorers) == 2 and set(explorers) <= set(recording.WEIGHTS)
    picks = learned[-1]
    assert np.isfinite(picks.observations).all() and picks.unloaded.sum() > 0
    came = picks.fates[np.arange(12), picks.actions] & 1
    assert (came <= picks.unloaded).all(), "fates are those of the picks"
    published = tmp_path / "heap" / "networks.safetensors"
    assert len(load_networks(published)) == 2
    assert read_provenance(tmp_path / "heap", "networks")["runs"] == 4 + 4
    written = published.read_bytes()
    make_networks(tmp_path, tmp_path)
    assert published.read_bytes() == written and len(learned) == 4, "all of it was kept"
    make_networks(tmp_path / "again", tmp_path / "again")
    assert (tmp_path / "again" / "heap" / "networks.safetensors").read_bytes() == written
    monkeypatch.setattr(recording, "STEPS", 3)
    make_networks(tmp_path, tmp_path)
    assert len(learned) == 12 and published.read_bytes() != written, "another question"
    assert len(list((tmp_path / "heap" / "picks").glob("*.json"))) == 6, "other explorers, too"
