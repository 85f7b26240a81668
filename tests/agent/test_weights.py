import json

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from safetensors.torch import save_file

from tests.agent.networks import HeightNetwork, peq, weights
from unload import Greedy, PEQNetwork, load_policy, policies, save_policy
from unload.network.variants import NETWORKS


@pytest.fixture
def observations(rng) -> np.ndarray:
    return rng.uniform(-1, 1, (40, 25, 3)).astype(np.float32)


def of_network(name: object) -> dict[str, str]:
    """The metadata of a policy's file."""
    settings = {"network": name, "n_features": 8, "equalize": True, "ties": "noise"}
    return {"policy": json.dumps(settings)}


def test_only_learned_policies_are_saved(tmp_path):
    class Subclass(PEQNetwork):
        """Its file would be read as another network."""

    others = (Greedy(network, equalize=False) for network in (HeightNetwork(), Subclass()))
    for policy in (policies.highest, *others):
        with pytest.raises(TypeError, match="policy is .*; expected a Greedy of one of PEQNetwork"):
            save_policy(policy, tmp_path / "policy.safetensors")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("kind", NETWORKS.values())
@pytest.mark.parametrize(("equalized", "ties"), [(True, "average"), (False, "noise")])
def test_a_saved_policy_comes_back(tmp_path, observations, rng, equalized, ties, kind):
    network = kind(6, torch.Generator().manual_seed(0))
    policy, path = Greedy(network, equalized, ties), tmp_path / "policy.safetensors"
    save_policy(policy, path)
    loaded = load_policy(path)
    assert type(loaded.network) is kind
    assert (loaded.equalize, loaded.ties, loaded.network.n_features) == (equalized, ties, 6)
    for mine, theirs in zip(weights(loaded.network), weights(policy.network)):
        assert torch.equal(mine, theirs)
    masks = np.ones(observations.shape[:2])
    assert (loaded(observations, masks, rng) == policy(observations, masks, rng)).all()


def test_equal_policies_give_equal_bytes(tmp_path):
    paths = [tmp_path / "a.safetensors", tmp_path / "b.safetensors"]
    for path in paths:
        save_policy(Greedy(peq(), True), path)
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match="none.safetensors"):
        load_policy(tmp_path / "none.safetensors")


@pytest.mark.parametrize("content", [b"", b"weights", None], ids=["empty", "text", "half"])
def test_a_damaged_file_is_refused(tmp_path, content):
    path = tmp_path / "policy.safetensors"
    save_policy(Greedy(peq(), True), path)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2] if content is None else content)
    with pytest.raises(ValueError, match="policy.safetensors is not a safetensors file"):
        load_policy(path)


@pytest.mark.parametrize(
    "metadata",
    [None, {"format": "pt"}, *map(of_network, ("Unknown", "EquivariantStack", [], None))],
)
def test_weights_of_others_are_refused(tmp_path, metadata):
    path = tmp_path / "foreign.safetensors"
    save_file(peq().state_dict(), path, metadata=metadata)
    with pytest.raises(ValueError, match="foreign.safetensors does not hold a policy"):
        load_policy(path)


@pytest.mark.parametrize(
    ("owner", "name", "value"),
    [
        ("network", "n_features", 9),
        ("network", "n_features", "many"),
        ("network", "n_features", 0),
        ("policy", "equalize", "maybe"),
        ("policy", "ties", "coin"),
    ],
)
def test_settings_that_do_not_fit_are_refused_by_name(tmp_path, owner, name, value):
    path, policy = tmp_path / "changed.safetensors", Greedy(peq(), True)
    setattr(policy if owner == "policy" else policy.network, name, value)
    save_policy(policy, path)
    with pytest.raises(ValueError, match="changed.safetensors does not hold a policy"):
        load_policy(path)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_weights_that_are_not_finite_are_refused(tmp_path, value):
    path, policy = tmp_path / "nan.safetensors", Greedy(peq(), True)
    torch.nn.init.constant_(policy.network.scorer.bias, value)
    save_policy(policy, path)
    with pytest.raises(ValueError, match="nan.safetensors does not hold a policy"):
        load_policy(path)


def test_every_flipped_bit_is_noticed(tmp_path, rng):
    path = tmp_path / "policy.safetensors"
    save_policy(Greedy(peq(), True), path)
    whole = path.read_bytes()
    for place in rng.choice(len(whole), 200, replace=False):
        damaged = bytearray(whole)
        damaged[place] ^= 1 << int(rng.integers(8))
        path.write_bytes(damaged)
        with pytest.raises(ValueError, match="policy.safetensors"):
            load_policy(path)


def test_weights_of_another_dtype_are_refused(tmp_path):
    """They were once cast to single precision, where a large one is infinite."""
    path, policy = tmp_path / "policy.safetensors", Greedy(peq().double(), True)
    with pytest.raises(TypeError, match="extractor.weight of dtype torch.float64; expected"):
        save_policy(policy, path)
    assert not path.exists()


@given(
    name=st.sampled_from(sorted(NETWORKS)),
    n_features=st.integers(1, 20).map(lambda n: 2 * n),  # attention has two heads
    equalized=st.booleans(),
    ties=st.sampled_from(["noise", "average"]),
    seed=st.integers(0, 2**31),
)
@settings(max_examples=30)
def test_any_policy_comes_back(tmp_path_factory, name, n_features, equalized, ties, seed):
    network = NETWORKS[name](n_features, torch.Generator().manual_seed(seed))
    path = tmp_path_factory.getbasetemp() / "policy.safetensors"
    save_policy(Greedy(network, equalized, ties), path)
    loaded = load_policy(path)
    assert type(loaded.network) is type(network)
    assert (loaded.equalize, loaded.ties) == (equalized, ties)
    for one, other in zip(weights(loaded.network), weights(network), strict=True):
        assert torch.equal(one, other)
