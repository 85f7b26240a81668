"""Heaps of other sizes and training with variation, at reduced size."""

from functools import partial

import numpy as np
import pytest
import torch

from unload.heap.env import HeapEnv, stored_heaps
from unload.heap.learning import load_network, save_network
from unload.heap.network import HeapNetwork
from unload.reproduce import heap_variation
from unload.reproduce.heap_learning import network_path


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Episodes of two picks of boxes nearby, on parts of stored heaps; what was played."""
    played = []

    def make(rng, scale):
        whole = stored_heaps("train")[0]
        return whole.only(np.sort(rng.choice(len(whole), 20, replace=False)))

    def env(**kwargs):
        played.append(kwargs)
        return HeapEnv(max_picks=2, **kwargs)

    monkeypatch.setattr(heap_variation, "settled_heap", make)
    monkeypatch.setattr(heap_variation, "HeapEnv", env)
    monkeypatch.setattr(heap_variation, "PHYSICS", "near")
    monkeypatch.setattr(heap_variation, "MAX_PICKS", 2)
    monkeypatch.setattr(heap_variation, "HEAPS", 2)
    return played


def test_a_sized_heap_has_larger_boxes_and_is_kept(tmp_path, monkeypatch):
    heap = heap_variation.sized_heap(1, 2, 0.8, tmp_path)
    assert heap.sizes == pytest.approx(0.8 * heap_variation.package_sizes(heap.packages))
    monkeypatch.setattr(heap_variation, "settled_heap", None)
    again = heap_variation.sized_heap(1, 2, 0.8, tmp_path)
    assert again.positions.tobytes() == heap.positions.tobytes()


def test_scales_are_within_their_range_and_differ():
    scales = [heap_variation.varied_scale(number) for number in range(20)]
    low, high = heap_variation.SCALES
    assert low <= min(scales) < max(scales) <= high and len(set(scales)) > 15
    assert scales[3] == heap_variation.varied_scale(3)


def test_episodes_differ_in_friction_and_mass_and_networks_learn_from_them(
    tmp_path, monkeypatch, quick
):
    network = HeapNetwork("own", 8, torch.Generator().manual_seed(0))
    save_network(network, network_path(0, "pairs", 0.0, 0, tmp_path))
    learned = []

    def fit(picks, seed, kind, gamma, steps):
        learned.append((len(picks), seed, kind, gamma, steps))
        return network

    monkeypatch.setattr(heap_variation, "fit", fit)
    no_picks = heap_variation.joined
    monkeypatch.setattr(heap_variation, "read_picks", lambda runs_dir, rounds: None)
    monkeypatch.setattr(heap_variation, "joined", lambda parts: no_picks(parts[1:]))
    make = partial(heap_variation.variation_data, 6, 1, 2, 5, tmp_path, progress=False)
    paths = make()
    assert learned == [(6, 0, "pairs", 0.0, 5), (6, 1, "pairs", 0.0, 5)]
    assert paths == heap_variation.varied_paths(tmp_path)
    assert load_network(paths[0]).kind == "own"
    for name, (low, high) in (
        ("friction", heap_variation.FRICTIONS), ("mass", heap_variation.MASSES)
    ):  # fmt: skip
        drawn = [kwargs[name] for kwargs in quick]
        assert len(set(drawn)) == 3 and low <= min(drawn) < max(drawn) <= high
    assert {len(kwargs["heaps"][0]) for kwargs in quick} == {20}
    make()
    assert len(quick) == 3 and len(learned) == 2, "kept"


def test_missing_networks_are_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="heap-learning makes it"):
        heap_variation.variation_data(2, runs_dir=tmp_path, progress=False)
    with pytest.raises(FileNotFoundError, match="heap-variation makes it"):
        heap_variation.varied_paths(tmp_path)
