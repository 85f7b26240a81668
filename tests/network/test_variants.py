from collections.abc import Callable

import numpy as np
import pytest
import torch

from unload import AttentionNetwork, EquivariantStack, PEQNetwork, TwoLayerScorer
from unload.network.variants import NETWORKS

ITEMS = torch.zeros(2, 4, 3)
VARIANTS = (TwoLayerScorer, EquivariantStack, AttentionNetwork)


@pytest.fixture(params=NETWORKS.values())
def kind(request) -> type:
    return request.param


@pytest.fixture
def items(rng) -> Callable[..., torch.Tensor]:
    """``items(batch, count)``: random observations."""
    return lambda *shape: torch.from_numpy(rng.uniform(-1, 1, (*shape, 3)).astype(np.float32))


def make(kind: type, n_features: int = 16, seed: int = 0) -> torch.nn.Module:
    return kind(n_features, torch.Generator().manual_seed(seed))


def test_permuting_the_items_permutes_the_values(kind, items, rng):
    network, batch = make(kind, 64), items(4, 128)
    assert kind().n_features == 64
    order = torch.from_numpy(rng.permutation(128))
    values = network(batch)
    assert values.std(dim=1).min() > 1e-3
    torch.testing.assert_close(network(batch[:, order]), values[:, order], atol=1e-6, rtol=0)


@pytest.mark.parametrize("other_kind", [PEQNetwork, *VARIANTS])
def test_other_items_change_the_choice_but_for_the_papers_network(items, other_kind):
    """The better one of the same two items, in the company of six others."""
    batch = 3 * items(500, 8)
    batch[:, :2] = torch.tensor([[0.2, 0.1, 0.5], [0.1, 0.3, 0.4]])
    orders = []
    for seed in range(10):
        values = make(other_kind, seed=seed)(batch)
        orders.append(len((values[:, 0] > values[:, 1]).unique()))
    assert max(orders) == (1 if other_kind is PEQNetwork else 2)


def test_the_two_layer_scorer_is_the_papers_network_with_a_hidden_layer(items):
    """Written out as in Sec. III-G: global features beside each item's own."""
    network, batch = make(TwoLayerScorer), items(3, 9)
    own = torch.relu(network.extractor(batch))
    pooled = torch.cat([own.amin(dim=1), own.amax(dim=1), own.mean(dim=1)], dim=1)
    enhanced = torch.cat([own, pooled[:, None].expand(-1, 9, -1)], dim=2)
    values = torch.tanh(network.scorer(torch.relu(network.hidden(enhanced)))).squeeze(2)
    torch.testing.assert_close(network(batch), values)


def test_the_stack_is_three_layers_on_own_features_and_maxima(items):
    network, own = make(EquivariantStack), items(3, 9)
    values = network(own)
    for layer in network.layers:
        maxima = own.amax(dim=1)[:, None].expand_as(own)
        own = torch.relu(layer(torch.cat([own, maxima], dim=2)))
    assert len(network.layers) == 3
    torch.testing.assert_close(values, torch.tanh(network.scorer(own)).squeeze(2))


def test_the_attention_network_is_two_blocks_with_normalization_first(items):
    network, batch = make(AttentionNetwork), items(3, 9)
    own = network.extractor(batch)
    for block in network.blocks:
        normed = block.norm1(own)
        own = own + block.self_attn(normed, normed, normed)[0]
        own = own + block.linear2(torch.relu(block.linear1(block.norm2(own))))
    values = torch.tanh(network.scorer(network.norm(own))).squeeze(2)
    assert len(network.blocks) == 2
    torch.testing.assert_close(network(batch), values)


@pytest.mark.parametrize("n", [2, 64])
def test_parameter_counts(n):
    attention = 2 * ((3 * n * n + 3 * n) + (n * n + n) + (4 * n * n + 3 * n) + 4 * n)
    counts = {
        PEQNetwork: 8 * n + 1,
        TwoLayerScorer: 4 * n + (4 * n * n + n) + (n + 1),
        EquivariantStack: (6 * n + n) + 2 * (2 * n * n + n) + (n + 1),
        AttentionNetwork: 4 * n + attention + 2 * n + (n + 1),
    }
    for kind, count in counts.items():
        assert sum(parameter.numel() for parameter in kind(n).parameters()) == count, kind


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
    """All rows count then."""
    network, batch = make(kind).train(training), items(2, 6)
    present = torch.tensor([[False] * 6, [True] + [False] * 5])
    values = network(batch, present)
    assert values.isfinite().all()
    torch.testing.assert_close(values[0], network(batch)[0], atol=1e-6, rtol=1e-5)
    values.sum().backward()
    assert all(value.grad.isfinite().all() for value in network.parameters())


@pytest.mark.parametrize("padded", [False, True])
def test_every_weight_has_a_gradient(kind, items, padded):
    network, batch = make(kind), items(8, 20)
    present = torch.arange(20).expand(8, -1) < 12 if padded else None
    values = network(batch, present)
    values[:, :12].square().sum().backward()
    for name, value in network.named_parameters():
        assert value.grad.isfinite().all() and value.grad.any(), name


@pytest.mark.parametrize(
    ("observations", "present", "error", "message"),
    [
        *(
            (torch.zeros(shape), None, ValueError, r"observations has shape .*expected \(batch, ")
            for shape in [(4, 3), (2, 4, 2), (2, 4, 4), (2, 0, 3)]
        ),
        (np.zeros((1, 4, 3)), None, TypeError, "observations is a ndarray; expected a tensor"),
        (torch.zeros((1, 4, 3), dtype=int), None, TypeError, "dtype torch.int64; expected torch."),
        (ITEMS, np.ones((2, 4), bool), TypeError, "present is a ndarray; expected a tensor"),
        (ITEMS, torch.ones(2, 4), TypeError, "present has dtype torch.float32; expected torch.b"),
        (ITEMS, torch.ones(2, 5, dtype=bool), ValueError, r"shape \(2, 5\); expected \(2, 4\)"),
    ],
)
def test_bad_arguments_are_refused(kind, observations, present, error, message):
    with pytest.raises(error, match=message):
        make(kind)(observations, present)


@pytest.mark.parametrize(("n", "error"), [(0, ValueError), (1.5, TypeError), (True, TypeError)])
def test_bad_numbers_of_features_are_refused(kind, n, error):
    with pytest.raises(error, match="n_features is"):
        kind(n)


def test_each_head_has_as_many_features():
    with pytest.raises(ValueError, match="n_features is 5; expected a multiple of 2"):
        AttentionNetwork(5)
