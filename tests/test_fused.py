"""The fused update and choice against PyTorch."""

import numpy as np
import pytest
import torch
from torch.nn.functional import smooth_l1_loss

from unload import fused
from unload.agent import DQN
from unload.network import PEQNetwork

BATCH, ITEMS = 300, 128


@pytest.fixture
def batch(rng):
    return {
        "observations": rng.uniform(-1, 1, (BATCH, ITEMS, 3)).astype(np.float32),
        "actions": rng.integers(ITEMS, size=BATCH),
        "rewards": rng.choice(np.array([-1, 1], np.float32), BATCH),
    }


def network(n_features, seed=0):
    return PEQNetwork(n_features, torch.Generator().manual_seed(seed))


def reference(net, batch, beta):
    """Loss and gradients by PyTorch in double precision."""
    double = PEQNetwork(net.n_features).double()
    double.load_state_dict({name: value.double() for name, value in net.state_dict().items()})
    values = double(torch.from_numpy(batch["observations"]).double())
    chosen = values.gather(1, torch.from_numpy(batch["actions"])[:, None]).squeeze(1)
    loss = smooth_l1_loss(chosen, torch.from_numpy(batch["rewards"]).double(), beta=beta)
    loss.backward()
    return loss.item(), [parameter.grad for parameter in double.parameters()]


@pytest.mark.parametrize("n_features", [1, 16, 37, 64])
@pytest.mark.parametrize("beta", [0.3, 1.0])
def test_gradients_are_those_of_pytorch(batch, n_features, beta):
    net = network(n_features)
    loss = fused.loss_and_gradients(net, *batch.values(), beta)
    expected_loss, expected = reference(net, batch, beta)
    assert loss == pytest.approx(expected_loss, rel=1e-5)
    for parameter, gradient in zip(net.parameters(), expected):
        error = (parameter.grad - gradient).abs().max().item()
        assert error < 1e-5 * max(gradient.abs().max().item(), 1e-2)


@pytest.mark.parametrize("items", [1, 2, 5, 127])
def test_any_number_of_items_will_do(batch, items):
    batch["observations"] = np.ascontiguousarray(batch["observations"][:, :items])
    batch["actions"] %= items
    net = network(16)
    loss = fused.loss_and_gradients(net, *batch.values())
    expected_loss, expected = reference(net, batch, beta=1.0)
    assert loss == pytest.approx(expected_loss, rel=1e-5)
    for parameter, gradient in zip(net.parameters(), expected):
        assert torch.allclose(parameter.grad.double(), gradient, atol=1e-6)


def test_choice_is_that_of_the_network(batch, rng):
    net = network(64)
    allowed = rng.random((BATCH, ITEMS)) < 0.3
    values = net(torch.from_numpy(batch["observations"]))
    expected = values.masked_fill(torch.from_numpy(~allowed), -torch.inf).argmax(dim=1).numpy()
    actions = fused.greedy_actions(net, batch["observations"], allowed)
    assert np.mean(actions == expected) > 0.99  # tanh may round two scores to one value
    rows = np.arange(BATCH)
    best = values.detach().numpy()
    assert np.allclose(best[rows, actions], best[rows, expected], atol=1e-6)
    assert allowed[rows, actions].all()


def test_fused_and_plain_updates_learn_the_same(batch):
    agents = [DQN(network(16), fused_update=choice) for choice in (True, False)]
    losses = [[agent.update(batch) for _ in range(20)] for agent in agents]
    assert losses[0] == pytest.approx(losses[1], abs=1e-5)
    assert losses[0][-1] < losses[0][0]


def test_two_updates_give_equal_bits(batch):
    states = []
    for _ in range(2):
        agent = DQN(network(37), fused_update=True)
        agent.update(batch)
        states.append([p.detach().numpy().tobytes() for p in agent.network.parameters()])
    assert states[0] == states[1]


@pytest.mark.parametrize("name", ["observations", "rewards"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_input_that_is_not_finite_is_refused(batch, name, value):
    net = network(16)
    batch[name].flat[7] = value
    with pytest.raises(FloatingPointError, match="expected finite"):
        fused.loss_and_gradients(net, *batch.values())
    assert all(parameter.grad is None for parameter in net.parameters())


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("actions", np.full(BATCH, ITEMS), "actions holds 128 to 128"),
        ("actions", np.full(BATCH, -1), "actions holds -1"),
        ("actions", np.zeros(BATCH), "actions has shape .* dtype float64"),
        ("rewards", np.zeros(BATCH - 1, np.float32), "targets has shape"),
        ("observations", np.zeros((BATCH, ITEMS, 2), np.float32), "observations has shape"),
        ("observations", np.zeros((BATCH, ITEMS, 3)), "observations .* dtype float64"),
    ],
)
def test_bad_batches_are_refused(batch, name, value, message):
    with pytest.raises(ValueError, match=message):
        fused.loss_and_gradients(network(4), *(batch | {name: value}).values())


def test_choice_among_nothing_finite_is_refused():
    observations = np.full((2, ITEMS, 3), np.nan, np.float32)
    with pytest.raises(FloatingPointError, match="no allowed action of a finite value"):
        fused.greedy_actions(network(4), observations, np.ones((2, ITEMS), bool))


class Subclass(PEQNetwork):
    pass


@pytest.mark.parametrize(
    "other", [PEQNetwork(4).double(), Subclass(4), torch.nn.Linear(3, 1)], ids=type
)
def test_rule_of_where_it_applies(other):
    assert fused.applies(network(4))
    assert not fused.applies(other)
    with pytest.raises(ValueError, match="fused_update is True"):
        DQN(other, fused_update=True)
