import numpy as np
import pytest
import torch

from tests.agent.runs import HeightNetwork, Subclass, peq, weights
from unload import Greedy, equalize, load_policy, save_policy
from unload.agent.greedy import greedy_actions, settings_of
from unload.agent.learner import best_actions
from unload.network.weights import write_weights
from unload.task import PADDING, VERSION


@pytest.fixture
def observations(rng) -> np.ndarray:
    return rng.uniform(-1, 1, (40, 25, 3)).astype(np.float32)


@pytest.mark.parametrize("ties", ["noise", "average", "not equalized"])
def test_greedy_equalizes_what_its_network_expects(observations, rng, ties):
    masks, equalized = np.ones(observations.shape[:2]), ties != "not equalized"
    policy = Greedy(peq(), True, ties) if equalized else Greedy(peq(), False)
    seen = equalize(observations, ties).astype(np.float32) if equalized else observations
    assert (policy(observations, masks, rng) == greedy_actions(peq(), seen, masks)).all()
    with pytest.raises(ValueError, match="observations"):
        policy(observations[0], masks[:1], rng)


@pytest.mark.parametrize("ties", ["noise", "average"])
def test_padded_rows_change_no_choice(observations, rng, ties):
    """Neither of ranks nor of a network that averages over the rows that hold a box."""
    network = HeightNetwork()  # whose fused twin there is not

    def forward(seen, present=None):
        held = torch.ones(seen.shape[:2]) if present is None else present.float()
        middle = (seen[..., 0] * held).sum(dim=1, keepdim=True) / held.sum(dim=1, keepdim=True)
        return -seen[..., 2] * (seen[..., 0] - middle - 0.1)

    network.forward = forward
    padded = np.concatenate([observations, np.full((40, 7, 3), PADDING, np.float32)], axis=1)
    masks = np.ones(padded.shape[:2])
    masks[:, 25:] = 0
    policy = Greedy(network, True, ties)
    chosen = policy(padded, masks, rng)
    assert np.array_equal(chosen, policy(observations, masks[:, :25], rng))
    assert len({*chosen}) > 5


@pytest.mark.parametrize("value", [torch.nan, torch.inf])
@pytest.mark.parametrize("layer", ["scorer", "extractor"])
def test_a_weight_that_is_not_finite_chooses_nothing(observations, layer, value):
    """It once picked row 0 without a word, or passed over the items that it spoiled."""
    allowed, network = np.ones(observations.shape[:2], bool), peq(4)
    with torch.no_grad():
        getattr(network, layer).weight[0, 0] = value
    for choose in (greedy_actions, best_actions):
        with pytest.raises(FloatingPointError, match="has an allowed action whose value is not"):
            choose(network, observations, allowed)


@pytest.mark.parametrize(
    ("network", "fresh"), [(HeightNetwork(-2.0), HeightNetwork()), (Subclass(8), Subclass(8))]
)
def test_a_policy_of_ones_own_network_comes_back_into_one_of_its_kind(tmp_path, network, fresh):
    save_policy(Greedy(network, equalize=True), tmp_path / "policy.safetensors")
    loaded = load_policy(tmp_path / "policy.safetensors", fresh)
    assert loaded.network is fresh and torch.equal(*(weights(n)[0] for n in (fresh, network)))
    message = "holds no policy .* it is of a tests.*(Subclass|HeightNetwork); expected one"
    for other in (None, peq()):
        with pytest.raises(ValueError, match=message):
            load_policy(tmp_path / "policy.safetensors", other)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("network", value) for value in ("EquivariantStack", [])),
        ("n_features", "many"),
        ("n_features", 10**9),  # 28 GB, if it were built
        ("n_features", 66),  # 8 of its 65 weights would be enough
        ("equalize", "maybe"),
        ("ties", "coin"),
    ],
)
def test_settings_that_do_not_fit_are_refused_by_name(tmp_path, name, value):
    path, settings = tmp_path / "changed.safetensors", settings_of(Greedy(peq(), True))
    write_weights(path, "policy", settings | {name: value}, peq().state_dict())
    with pytest.raises(ValueError, match="changed.safetensors holds no policy"):
        load_policy(path)


@pytest.mark.parametrize(("equalized", "ties"), [(True, "average"), (False, "noise")])
def test_a_saved_policy_comes_back_with_its_card(tmp_path, equalized, ties):
    policy, path = Greedy(peq(6), equalized, ties), tmp_path / "policy.safetensors"
    policy.card = {"loads": "my own", "msr": {"these": 0.5}}
    save_policy(policy, path)
    loaded, whole = load_policy(path), path.read_bytes()
    assert (loaded.equalize, loaded.ties, loaded.network.n_features) == (equalized, ties, 6)
    assert all(map(torch.equal, weights(loaded.network), weights(policy.network)))
    assert loaded.card == {"version": VERSION, "loads": "my own", "msr": {"these": 0.5}}
    said = f"Greedy(PEQNetwork, equalize={equalized}, ties={ties!r})"
    assert repr(loaded) == said == str(Greedy(peq(6), equalized, ties))
    assert str(loaded).startswith(f"{said}\n  version: ")
    assert str(loaded).endswith("\n  loads: my own\n  msr: {'these': 0.5}")
    save_policy(loaded, path)
    assert path.read_bytes() == whole
    for card in ({"msr": np.float32(0.5)}, {"seeds": {10: 0.5, 9: 1.0}}):
        with pytest.raises(TypeError, match="card is {.*; expected what JSON can hold"):
            save_policy(Greedy(peq(), True, card=card), path)
    assert path.read_bytes() == whole, "what is refused is not written"
