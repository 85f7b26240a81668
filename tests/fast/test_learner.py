"""Our Adam against PyTorch's."""

from copy import deepcopy

import numpy as np
import pytest
import torch

from tests.agent.runs import peq
from unload.fast.learner import FusedLearner


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
        gradients = rng.normal(size=len(before)) * 10.0 ** -(number % 7)
        gradients[3] = 0
        learner.step(gradients)
        for weight, part in zip(theirs.parameters(), np.split(gradients, ends)):
            weight.grad = torch.from_numpy(part.copy()).reshape(weight.shape)
        reference.step()
    after = flat(ours)
    assert np.abs(after - flat(theirs)).max() < 1e-5 < np.abs(after - before).max()
    assert after[3] == before[3]


def test_a_gradient_as_small_as_epsilon_moves_a_weight_by_half_as_much():
    """A constant gradient g moves a weight by g / (|g| + 1e-8) of the learning rate."""
    network = peq(1)
    before, learner = flat(network), FusedLearner(network, 0.01, beta=1.0)
    for _ in range(3):
        learner.step(np.array([1.0, 1e-8, -3e-8, *np.zeros(6)]))
    moved = flat(network) - before
    assert moved == pytest.approx([-0.03, -0.015, 0.0225, *np.zeros(6)], rel=1e-4)
