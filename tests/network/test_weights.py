"""Files of weights; those of policies and of heap networks have tests beside them, too."""

import json

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load_file, save_file

from unload.network import weights
from unload.network.weights import as_arrays, as_tensors, read_weights, write_weights

SETTINGS = {"sizes": [3, 2], "ends": "open"}
WEIGHTS = {"a.bias": torch.arange(3.0), "b.weight": torch.full((2, 2), 0.5)}


@pytest.fixture
def path(tmp_path):
    write_weights(tmp_path / "w.safetensors", "pair", SETTINGS, WEIGHTS)
    return tmp_path / "w.safetensors"


def test_they_come_back_as_they_were_even_if_they_share_memory_or_are_turned(tmp_path):
    shared = torch.arange(6.0).reshape(2, 3)
    write_weights(tmp_path / "w", "pair", SETTINGS, {"a": shared, "b": shared, "c": shared.T})
    settings, tensors = read_weights(tmp_path / "w", "pair", lambda *made: made)
    assert settings == SETTINGS
    assert torch.equal(tensors["a"], tensors["b"]) and torch.equal(tensors["c"], shared.T)


def test_the_digest_stays_so_that_published_files_can_be_read(path):
    with safe_open(path, "pt") as file:
        stored = json.loads(file.metadata()["pair"])
    assert stored == SETTINGS | {"digest": "fdec04c13f517f2b5cae2c5784d6809b"}


def test_every_flipped_bit_is_noticed(path, rng):
    """So is a file that is empty, or cut short."""
    whole = path.read_bytes()
    damages = [b"", whole[: len(whole) // 2]]
    for place in range(len(whole)):
        damages.append(bytearray(whole))
        damages[-1][place] ^= 1 << int(rng.integers(8))
    for damaged in damages:
        path.write_bytes(damaged)
        with pytest.raises(ValueError, match="w.safetensors (is not a safetensors file|holds no)"):
            read_weights(path, "pair", lambda *made: made)


def test_files_without_a_digest_or_of_another_kind_or_not_finite_are_refused(path):
    with pytest.raises(ValueError, match="w.safetensors holds no policy of unload"):
        read_weights(path, "policy", print)
    for metadata in (None, {"pair": '{"sizes": [3, 2]}'}):
        save_file(load_file(path), path, metadata)
        with pytest.raises(ValueError, match="w.safetensors holds no pair of unload"):
            read_weights(path, "pair", print)
    write_weights(path, "pair", {}, WEIGHTS | {"a.bias": torch.tensor([0, float("inf")])})
    with pytest.raises(ValueError, match="w.safetensors holds no pair .* is not finite"):
        read_weights(path, "pair", print)


def test_a_file_of_another_dtype_is_refused(path, monkeypatch):
    halves = {name: weight.half() for name, weight in WEIGHTS.items()}
    with pytest.raises(TypeError, match="a.bias of dtype torch.float16; expected torch.float32"):
        write_weights(path, "pair", {}, halves)
    with monkeypatch.context() as elsewhere:
        elsewhere.setattr(weights, "_check_dtypes", lambda name, tensors: None)
        write_weights(path, "pair", {}, halves)
    with pytest.raises(ValueError, match="holds no pair .* a.bias of dtype torch.float16"):
        read_weights(path, "pair", print)


def test_tensors_are_arrays_of_the_same_memory_at_any_depth_and_back():
    """Their names become text, as in a file."""
    tensor = torch.zeros(2, requires_grad=True)
    arrays = as_arrays({"state": {0: tensor}, "groups": [(tensor, "a")]})
    arrays["state"]["0"][0] = 5
    assert arrays["groups"][0][0].tolist() == tensor.tolist() == [5, 0]
    again = as_tensors(arrays)
    assert again["groups"][0][1] == "a" and torch.equal(again["state"]["0"], tensor)
