import numpy as np
import pytest

from unload.env.settled import PATH, TRIPLES, columns_of, read_settled
from unload.load.contacts import ABOVE
from unload.load.substacks import COLUMNS, build_load
from unload.reproduce import drift
from unload.support import files
from unload.support.provenance import read_provenance


def kinds_of(variants: np.ndarray) -> np.ndarray:
    """(walls, columns) of all loads, one after the other."""
    return np.concatenate([columns_of(build_load(each))[0] for each in variants])


def test_each_kind_of_column_stands_in_each_place_equally_often(rng):
    variants = drift.planned_variants(4, rng)
    assert variants.shape == (9, 12, 3, 4)
    for column in kinds_of(variants).T:
        assert np.bincount(column, minlength=TRIPLES).tolist() == [4] * TRIPLES


def test_boxes_settle_with_all_and_with_nothing_on_them(rng, monkeypatch):
    monkeypatch.setattr(drift, "SETTLE_TIME", 0.05)
    variants = rng.integers(3, size=(1, 3, 4))
    load, offsets = build_load(variants), drift.settled_load(variants)
    assert offsets.shape == (len(load), 4) and offsets.dtype == np.int64
    assert -1500 < offsets[:, 2].mean() < -20 and np.abs(offsets).max() < 5000
    bare = np.array([not len(load.contacts.of(ABOVE, box)) for box in range(len(load))])
    assert (offsets[bare, 2] == offsets[bare, 3]).all()
    assert offsets[~bare, 3].mean() > offsets[~bare, 2].mean() + 50


def test_what_was_simulated_is_found_again_by_its_kind(tmp_path, monkeypatch):
    def settled(variants):
        """The number of the column's kind, the wall, and the box's number in its column."""
        kinds, columns, numbers = columns_of(build_load(variants))
        calls.append(kinds)
        return np.stack([kinds.reshape(-1)[columns], columns % 4, columns // 4, numbers], axis=1)

    calls = []
    monkeypatch.setattr(drift, "settled_load", settled)
    for _ in range(2):  # the second time, all are kept
        drift.drift_data(4, tmp_path, tmp_path / "runs", n_jobs=1, progress=False)
    assert len(calls) == 9
    library = read_settled(tmp_path / "settled.npz")
    assert library.starts.shape == (len(COLUMNS), TRIPLES, 5)
    for (column, kind, sample), first in np.ndenumerate(library.starts[..., :-1]):
        boxes = np.rint(library.offsets[first : library.starts[column, kind, sample + 1]] * 1e6)
        assert (boxes[:, 0] == kind).all() and (boxes[:, 1] == column).all()
        assert boxes[:, 3].tolist() == list(range(len(boxes)))
    provenance = read_provenance(tmp_path, "settled")
    assert not provenance["reduced"] and provenance["runs"] == 9
    assert provenance["command"].endswith("drift")


def test_the_shipped_columns_are_few_and_of_the_plan():
    assert PATH.stat().st_size < 2**20
    settings = read_provenance(files.DATA, "settled")["settings"]
    assert settings["samples"] == drift.SAMPLES and settings["settle_time"] == drift.SETTLE_TIME
    library = read_settled(PATH)
    assert library.starts.shape[2] == drift.SAMPLES + 1
    assert library.offsets[:, 2].mean() == pytest.approx(-1e-3, abs=0.2e-3)
