import json

import numpy as np
import pandas as pd
import pytest

from unload import equalize
from unload.reproduce import random_picks
from unload.reproduce.fingerprint import training_fingerprint
from unload.reproduce.random_picks import TRANSFORMS, fit, offline_data


@pytest.fixture
def observations(rng):
    return rng.uniform(-1, 1, (5, 20, 3)).astype(np.float32)


@pytest.mark.parametrize("name", TRANSFORMS)
def test_features_keep_shape_and_dtype_and_leave_their_input(observations, name):
    before = observations.copy()
    seen = TRANSFORMS[name](observations)
    assert (seen.shape, seen.dtype) == (observations.shape, np.float32)
    assert np.array_equal(observations, before)


def test_features_are_what_their_names_say(observations):
    ranks = equalize(observations)
    assert np.array_equal(TRANSFORMS["positions"](observations), observations)
    assert np.array_equal(TRANSFORMS["noisy ranks"](observations), ranks)
    assert np.array_equal(TRANSFORMS["tied ranks"](observations), equalize(observations, "average"))
    for axes, letter in (([0], "x"), ([1], "y"), ([2], "z"), ([0, 1], "x and y")):
        expected = observations.copy()
        expected[..., axes] = ranks[..., axes]
        assert np.array_equal(TRANSFORMS[f"noisy ranks of {letter}"](observations), expected)
    stretched = TRANSFORMS["stretched positions"](observations)
    assert np.allclose(stretched.min(axis=1), -1) and np.allclose(stretched.max(axis=1), 1)
    assert np.allclose(TRANSFORMS["centred positions"](observations).mean(axis=1), 0, atol=1e-6)


def test_random_picks_are_those_of_their_seed():
    first, same, other = (random_picks.random_picks(3, seed) for seed in (1, 1, 2))
    assert first["observations"].shape == (192, 128, 3)
    assert set(np.unique(first["rewards"])) <= {-1, 1}
    assert all(np.array_equal(first[name], same[name]) for name in first)
    assert not np.array_equal(first["actions"], other["actions"])


def test_positions_teach_the_height_within_a_few_updates():
    row = fit("positions", 0, steps=40, updates=800, loads=2)
    assert row["msr_mask"] > 0.8  # at random 0.26
    assert row == fit("positions", 0, steps=40, updates=800, loads=2)


def test_finished_fits_are_kept(tmp_path, monkeypatch):
    size = {"steps": 2, "updates": 3, "loads": 1}
    for _ in range(2):
        offline_data(tmp_path, tmp_path / "runs", 1, seeds=1, progress=False, **size)
    kept = list((tmp_path / "runs").rglob("*.json"))
    assert len(kept) == len(TRANSFORMS)
    table = pd.read_csv(tmp_path / "study/offline.csv")
    assert table["features"].tolist() == list(TRANSFORMS)
    provenance = json.loads((tmp_path / "study/offline.provenance.json").read_text())
    assert provenance["reduced"] and provenance["fingerprint"] == training_fingerprint()
    # Fits of code that trains otherwise are not taken.
    monkeypatch.setattr(random_picks, "training_fingerprint", lambda: "another")
    monkeypatch.setattr(random_picks, "fit", lambda features, seed, **size: {"features": "anew"})
    offline_data(tmp_path, tmp_path / "runs", 1, seeds=1, progress=False, **size)
    assert set(pd.read_csv(tmp_path / "study/offline.csv")["features"]) == {"anew"}


def test_unknown_features_are_refused():
    with pytest.raises(ValueError, match="features"):
        fit("colours", 0)
