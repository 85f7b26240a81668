"""The fused update and choice, and our Adam, against PyTorch."""

import multiprocessing
from concurrent.futures import ThreadPoolExecutor
from copy import deepcopy
from unittest.mock import Mock

import numpy as np
import pytest
import torch
from torch.nn.functional import smooth_l1_loss

from tests.agent.runs import CONTAINER, Subclass, make_batch, peq, without_next
from unload import TrainConfig
from unload.agent.dqn import DQN
from unload.agent.training import Training
from unload.fast import fused
from unload.fast.learner import FusedLearner
from unload.network.peq import PEQNetwork

BATCH, ITEMS = 300, 128
FOR_TWO_THREADS = 2 * fused.CHUNK * fused._CHUNKS_PER_THREAD + 5


@pytest.fixture
def batch(rng):
    return without_next(make_batch(rng, BATCH, ITEMS))


def reference(net, batch, beta=1.0):
    """Loss and gradients by PyTorch in double precision."""
    double = PEQNetwork(net.n_features).double()
    double.load_state_dict({name: value.double() for name, value in net.state_dict().items()})
    values = double(torch.from_numpy(batch["observations"]).double())
    chosen = values.gather(1, torch.from_numpy(batch["actions"])[:, None]).squeeze(1)
    loss = smooth_l1_loss(chosen, torch.from_numpy(batch["rewards"]).double(), beta=beta)
    loss.backward()
    return loss.item(), [parameter.grad for parameter in double.parameters()]


def gradients(net, batch, *rest):
    """The gradients of all weights, one after the other, and the loss."""
    return fused.start_gradients(fused.weights_of(net), *batch.values(), *rest)()


def check(net, batch, beta=1.0, tolerance=1e-5):
    """Loss and gradients agree, the gradients relative to the largest of them."""
    *found, loss = gradients(net, batch, beta)
    expected_loss, expected = reference(net, batch, beta)
    assert loss == pytest.approx(expected_loss, rel=1e-5)
    flat = torch.cat([gradient.flatten() for gradient in expected]).numpy()
    assert len(flat) == len(found)
    assert np.abs(found - flat).max() <= tolerance * min(np.abs(flat).max(), 1)


@pytest.mark.parametrize("n_features", [64, 65, 130])
def test_gradients_are_those_of_pytorch(batch, n_features):
    check(peq(n_features), batch, 0.3)


def test_double_precision_decides_whether_a_feature_is_active():
    """Its value is 2⁻²⁶ - 2⁻³⁶; single precision rounds the first part away."""
    net = peq(1)
    with torch.no_grad():
        net.extractor.weight[:] = torch.tensor([-1 - 2.0**-12, 2.0**-26, 0])
        net.extractor.bias[:] = 1
        net.scorer.weight[:] = torch.tensor([1.0, 1.0, 1.0, 0.0])  # the mean does not count
    items = np.tile(np.array([1 - 2.0**-12 + 2.0**-24, 1, 0], np.float32), (1, 3, 1))
    check(net, {"observations": items, "actions": np.array([0]), "rewards": np.ones(1, np.float32)})


@pytest.fixture
def two_threads():
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    yield
    torch.set_num_threads(before)


def test_two_threads_give_the_bits_of_one(rng, two_threads, monkeypatch):
    submit = Mock(side_effect=ThreadPoolExecutor.submit)
    monkeypatch.setattr(ThreadPoolExecutor, "submit", lambda *work: submit(*work))
    net, batch = peq(64), without_next(make_batch(rng, FOR_TWO_THREADS, ITEMS))
    two = gradients(net, batch).tobytes()
    assert submit.call_count == 1
    torch.set_num_threads(1)
    assert gradients(net, batch).tobytes() == two
    assert submit.call_count == 1, "no thread where one is asked for"


@pytest.mark.needs("fork")
def test_a_forked_process_has_threads_of_its_own(rng, two_threads):
    net, batch = peq(8), without_next(make_batch(rng, FOR_TWO_THREADS, ITEMS))
    here = gradients(net, batch)[-1]
    fork = multiprocessing.get_context("fork")
    answers = fork.SimpleQueue()
    process = fork.Process(target=lambda: answers.put(gradients(net, batch)[-1]))
    process.start()
    process.join(60)
    try:
        assert not process.is_alive() and answers.get() == here
    finally:
        process.kill()


def test_choice_is_that_of_the_network(batch, rng):
    net = peq(64)
    allowed = rng.random((BATCH, ITEMS)) < 0.3
    values = net(torch.from_numpy(batch["observations"]))
    expected = values.masked_fill(torch.from_numpy(~allowed), -torch.inf).argmax(dim=1).numpy()
    actions = fused.best_actions(fused.weights_of(net), batch["observations"], allowed)
    assert np.mean(actions == expected) > 0.99  # tanh may round two scores to one value
    rows = np.arange(BATCH)
    best = values.detach().numpy()
    assert np.allclose(best[rows, actions], best[rows, expected], atol=1e-6)
    assert allowed[rows, actions].all()
    equal, mask = batch["observations"][:, [0, 0, 0]], np.tile([False, True, True], (BATCH, 1))
    assert (fused.best_actions(fused.weights_of(net), equal, mask) == 1).all(), "the first one"


@pytest.mark.parametrize("place", ["extractor.weight", "scorer.bias", "observations"])
def test_numbers_that_are_not_finite_are_an_error(batch, place):
    """Also where a ReLU is closed, and where the loss does not show them."""
    net = peq(4)
    with torch.no_grad():
        if place == "observations":
            net.extractor.weight[:] = -net.extractor.weight.abs()
            batch[place][0, 1 - batch["actions"][0] % 2] = np.inf
        else:
            net.get_parameter(place)[0] = torch.nan if "weight" in place else torch.inf
    with pytest.raises(FloatingPointError, match="are not all finite; expected finite obs"):
        gradients(net, batch)


@pytest.mark.parametrize(
    "other", [PEQNetwork(4).double(), Subclass(4), torch.nn.Linear(3, 1)], ids=type
)
def test_rule_of_where_it_applies(other):
    assert fused.applies(peq(4))
    assert not fused.applies(other)
    with pytest.raises(ValueError, match="fused_update is True"):
        DQN(other, fused_update=True)


@pytest.mark.parametrize("seed", range(60))
def test_any_update_is_that_of_double_precision(seed):
    """Also of networks that are dead or saturated, and where all features are active or tie."""
    rng = np.random.default_rng(seed)
    size, items, n_features = rng.integers(1, (70, 40, 80), endpoint=True)
    scale, bias = rng.choice([0.0, 0.1, 1.0, 4.0]), rng.choice([0.0, 3.0, -3.0])
    levels = rng.choice([2, 5, 1000])  # of coordinates: few make ties
    net = peq(int(n_features), seed)
    with torch.no_grad():
        for parameter in net.parameters():
            parameter *= scale
        net.extractor.bias += bias * scale
    batch = {
        "observations": (rng.integers(levels, size=(size, items, 3)) / levels).astype(np.float32),
        "actions": rng.integers(items, size=size),
        "rewards": rng.uniform(-1, 1, size).astype(np.float32),
    }
    check(net, batch, rng.uniform(0.1, 2), tolerance=1e-4)


def flat(network) -> np.ndarray:
    return torch.cat([weight.detach().flatten() for weight in network.parameters()]).numpy()


@pytest.mark.parametrize("learning_rate", [1e-3, 0.1])
def test_steps_are_those_of_pytorch(rng, learning_rate):
    ours = peq(2)
    theirs, before = deepcopy(ours).double(), flat(ours)
    learner = FusedLearner(ours, learning_rate, beta=1.0)
    reference = torch.optim.Adam(theirs.parameters(), learning_rate)
    ends = np.cumsum([weight.numel() for weight in theirs.parameters()])[:-1]
    for number in range(100):
        if number == 50:  # it goes on from a checkpoint
            state, learner = learner.state_dict(), FusedLearner(ours, 1.0, beta=1.0)
            learner.load_state_dict(state)
        gradients = rng.normal(size=len(before)) * 10.0 ** -(number % 7)
        gradients[3:5] = 0, 1e-8  # which is Adam's epsilon
        learner.step(gradients)
        for weight, part in zip(theirs.parameters(), np.split(gradients, ends)):
            weight.grad = torch.from_numpy(part.copy()).reshape(weight.shape)
        reference.step()
    after = flat(ours)
    assert np.abs(after - flat(theirs)).max() < 1e-5 < np.abs(after - before).max()
    assert after[3] == before[3]


def test_it_is_the_one_in_use(monkeypatch, rng):
    """In training and by a trained policy; PyTorch, some sixty times slower, is not asked."""
    run = Training(TrainConfig(**CONTAINER))
    monkeypatch.setattr(PEQNetwork, "forward", lambda *_: pytest.fail("PyTorch is asked"))
    for _ in range(10):
        run.step()
    assert run.agent.learner.steps > 0
    run.policy()(run.rollout.observations, run.rollout.allowed, rng)
