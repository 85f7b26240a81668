"""Heaps of boxes with other properties and training with variation, at reduced size."""

from functools import partial

import numpy as np
import pytest
import torch

from unload.heap.env import HeapEnv, stored_heaps
from unload.heap.learning import load_network, save_network
from unload.heap.network import HeapNetwork
from unload.physics.bullet import FRICTION
from unload.reproduce import heap, heap_learning, heap_variation
from unload.reproduce.heap_learning import network_path


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Episodes of two picks of boxes nearby, on parts of stored heaps; what was played."""
    played = []

    def make(rng, scale, friction):
        assert friction != FRICTION, "the heap settles with the friction that is played"
        whole = stored_heaps("train")[0]
        return whole.only(np.sort(rng.choice(len(whole), 20, replace=False)))

    def env(**kwargs):
        played.append(kwargs)
        return HeapEnv(max_picks=2, **kwargs)

    monkeypatch.setattr(heap, "settled_heap", make)
    monkeypatch.setattr(heap_variation, "HeapEnv", env)
    monkeypatch.setattr(heap_variation, "PHYSICS", "near")
    monkeypatch.setattr(heap_variation, "MAX_PICKS", 2)
    monkeypatch.setattr(heap_variation, "HEAPS", 2)
    return played


def test_a_heap_of_other_boxes_has_their_sizes_and_is_kept(tmp_path, monkeypatch):
    properties = heap_variation.Properties(0.8, 0.35, 2.0)
    first = heap_variation.varied_heap(1, 2, properties, tmp_path)
    assert first.sizes == pytest.approx(0.8 * heap_variation.package_sizes(first.packages))
    monkeypatch.setattr(heap, "settled_heap", None)
    again = heap_variation.varied_heap(1, 2, properties, tmp_path)
    assert again.positions.tobytes() == first.positions.tobytes()


def test_properties_are_within_their_ranges_and_differ():
    columns = zip(*(heap_variation.varied_properties(number) for number in range(20)))
    ranges = heap_variation.SCALES, heap_variation.FRICTIONS, heap_variation.MASSES
    for drawn, (low, high) in zip(columns, ranges, strict=True):
        assert low <= min(drawn) < max(drawn) <= high and len(set(drawn)) > 15
    assert heap_variation.varied_properties(3) == heap_variation.varied_properties(3)


def test_episodes_have_the_properties_of_their_heap_and_networks_learn_from_them(
    tmp_path, monkeypatch, quick
):
    network = HeapNetwork("own", 8, torch.Generator().manual_seed(0))
    save_network(network, network_path(0, heap_variation.VARIANT, 0, tmp_path))
    learned = []

    def fit(picks, seed, steps, **variant):
        learned.append((len(picks), seed, steps, variant["kind"]))
        return network

    monkeypatch.setattr(heap_learning, "fit", fit)
    make = partial(heap_variation.variation_data, 6, 1, 2, 5, tmp_path, progress=False)
    paths = make()
    assert learned == [(6, 0, 5, "fates"), (6, 1, 5, "fates")]
    assert paths == heap_variation.varied_paths(tmp_path)
    assert load_network(paths[0]).kind == "own"
    for name, (low, high) in (
        ("friction", heap_variation.FRICTIONS), ("mass", heap_variation.MASSES)
    ):  # fmt: skip
        drawn = [kwargs[name] for kwargs in quick]
        assert len(set(drawn)) == 2 and low <= min(drawn) < max(drawn) <= high
        assert drawn[0] == drawn[2], "one of two heaps again"
    assert {len(kwargs["heaps"][0]) for kwargs in quick} == {20}
    make()
    assert len(quick) == 3 and len(learned) == 2, "kept"


def test_missing_networks_are_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="heap-learning makes it"):
        heap_variation.variation_data(2, runs_dir=tmp_path, progress=False)
    with pytest.raises(FileNotFoundError, match="heap-variation makes it"):
        heap_variation.varied_paths(tmp_path)
