"""The paper's network, and how networks are made.

What holds for every ``kind`` is tested of those of the studies, too.
"""

import numpy as np
import pytest
import torch

from tests.agent.runs import HeightNetwork
from unload import PEQNetwork
from unload.network.factory import make_network


@pytest.fixture
def kind() -> type:
    return PEQNetwork


def make(kind: type, n_features: int = 16, seed: int = 0) -> torch.nn.Module:
    return kind(n_features, torch.Generator().manual_seed(seed))


def numpy_forward(peq: PEQNetwork, items: np.ndarray) -> np.ndarray:
    """Sec. III-G for one observation, item by item; (items, 3) → (items,)."""
    weights = {name: value.numpy() for name, value in peq.state_dict().items()}
    kernels, offsets = weights["extractor.weight"], weights["extractor.bias"]
    features = np.array(
        [[max(0, k @ item + o) for k, o in zip(kernels, offsets)] for item in items]
    )
    context = [features.min(axis=0), features.max(axis=0), features.mean(axis=0)]
    scores = []
    for own in features:
        enhanced = np.concatenate([own, *context])
        scores.append(np.tanh(weights["scorer.bias"][0] + weights["scorer.weight"][0] @ enhanced))
    return np.array(scores)


@pytest.mark.parametrize(("items", "n_features"), [(1, 16), (2, 1), (7, 16), (128, 64), (300, 16)])
def test_forward_is_the_papers_equations_for_any_number_of_items(rng, items, n_features):
    peq = make(PEQNetwork, n_features)
    batch = rng.uniform(-1, 1, (3, items, 3)).astype(np.float32)
    values = peq(torch.from_numpy(batch)).detach()
    assert values.shape == (3, items) and values.dtype == torch.float32
    expected = [numpy_forward(peq, observation) for observation in batch]
    assert values.numpy() == pytest.approx(np.array(expected), abs=1e-6)
    assert values.abs().max() < 1


def test_a_network_can_be_exported(items):
    """For any number of observations and items; ``torch.onnx.export`` begins with this."""
    peq, free = make(PEQNetwork).eval(), torch.export.Dim.DYNAMIC
    shapes = [{0: free, 1: free}]
    exported = torch.export.export(peq, (items(2, 128),), dynamic_shapes=shapes).module()
    for batch in (items(3, 128), items(5, 60)):
        torch.testing.assert_close(exported(batch), peq(batch))


def test_permuting_the_items_permutes_the_values(kind, items, rng):
    network, batch = make(kind, 64), items(4, 128)
    assert kind().n_features == 64
    order = torch.from_numpy(rng.permutation(128))
    values = network(batch)
    assert values.shape == (4, 128) and values.std(dim=1).min() > 1e-3
    torch.testing.assert_close(network(batch[:, order]), values[:, order], atol=1e-6, rtol=0)


def test_the_generator_alone_decides_the_weights(kind):
    weights = []
    for seed in (3, 3, 4):
        torch.manual_seed(len(weights))
        weights.append(make(kind, seed=seed).state_dict())
    first, same, other = weights
    for name, value in first.items():
        assert torch.equal(value, same[name])
        assert "norm" in name or not torch.equal(value, other[name]), name


def test_weights_are_drawn_from_plus_minus_one_over_root_inputs(kind):
    network = make(kind, 64)
    drawn = 0
    for name, value in network.named_parameters():
        if name.endswith("weight") and value.ndim == 2:
            bound = value.shape[1] ** -0.5
            bias = dict(network.named_parameters())[name.removesuffix("weight") + "bias"]
            assert bias.abs().max() <= bound and value.abs().max() <= bound
            assert value.abs().max() > 0.9 * bound
            drawn += 2
    norms = sum("norm" in name for name, _ in network.named_parameters())
    assert drawn + norms == len(list(network.parameters()))


@pytest.mark.parametrize("training", [True, False])
@pytest.mark.parametrize("content", [-100.0, 0.0, 100.0])
def test_what_absent_rows_hold_has_no_influence(kind, items, content, training):
    """Zeros, too, where all that is present is negative: a maximum may not begin at 0."""
    network, batch = make(kind).train(training), -items(5, 6).abs()
    present = torch.arange(6) < torch.arange(1, 6)[:, None]
    changed = batch.clone()
    changed[~present] = content
    with torch.no_grad():
        values = network(batch, present)
        assert torch.equal(network(changed, present)[present], values[present])
        assert not torch.equal(network(changed)[present], values[present])
        for row in range(5):
            alone = network(batch[row : row + 1, : row + 1])[0]
            torch.testing.assert_close(values[row, : row + 1], alone, atol=1e-6, rtol=1e-5)


@pytest.mark.parametrize("training", [True, False])
def test_values_and_gradients_are_finite_where_there_is_no_item(kind, items, training):
    """All rows count then; and every weight has a gradient where there are items."""
    network, batch = make(kind).train(training), items(9, 20)
    present = torch.arange(20).expand(9, -1) < 12
    present[0], present[1] = False, torch.arange(20) < 1
    values = network(batch, present)
    assert values.isfinite().all()
    torch.testing.assert_close(values[0], network(batch)[0], atol=1e-6, rtol=1e-5)
    values.square().sum().backward()
    for name, value in network.named_parameters():
        assert value.grad.isfinite().all() and value.grad.any(), name


def test_bad_numbers_of_features_are_refused(kind):
    for number, error in ((0, ValueError), (1.5, TypeError)):
        with pytest.raises(error, match=f"n_features is {number}"):
            kind(number)


def test_a_network_is_in_single_precision_on_the_cpu_whatever_pytorchs_defaults_are():
    torch.set_default_dtype(torch.float64)
    torch.set_default_device("meta")
    try:
        weight = make_network("peq", 4).extractor.weight
        assert (weight.dtype, weight.device.type) == (torch.float32, "cpu")
        assert torch.get_default_dtype() == torch.float64
    finally:
        torch.set_default_dtype(torch.float32)
        torch.set_default_device(None)


@pytest.mark.parametrize(
    ("returned", "error", "message"),
    [
        (None, TypeError, "what network returned is None; expected a torch.nn.Module"),
        (HeightNetwork().double(), TypeError, "weight of dtype torch.float64; expected torch.floa"),
        (HeightNetwork(torch.ones(2, 1, 1)), ValueError, r"\(2, 2, 3\); expected \(2, 3\)"),
    ],
)
def test_a_network_of_ones_own_that_cannot_be_trained_is_refused(returned, error, message):
    with pytest.raises(error, match=message):
        make_network(lambda n_features, generator: returned, 4)


@pytest.mark.parametrize("network", [int, lambda: None])
def test_a_function_of_other_arguments_is_refused_by_name(network):
    """It once was a TypeError of its own words."""
    message = "network is <.*; expected a function of n_features and a generator"
    with pytest.raises(TypeError, match=message):
        make_network(network, 4)


def test_a_network_is_tried_in_a_copy():
    """It may count its calls, and begins in the mode for training, in which the copy is not."""
    asked = []

    class Counting(PEQNetwork):
        calls = 0

        def forward(self, observations, present=None):
            self.calls += 1
            asked.append((self.training, present.dtype))
            return super().forward(observations, present)

    made = make_network(Counting, 4)
    assert made.training and made.calls == 0 and asked == [(False, torch.bool)]
