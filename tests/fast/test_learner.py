"""Our Adam against PyTorch's."""

import numpy as np
import pytest
import torch

from unload.fast.learner import Adam


@pytest.mark.parametrize("learning_rate", [1e-3, 0.1])
def test_steps_are_those_of_pytorch(rng, learning_rate):
    ours = [rng.normal(size=count).astype(np.float32) for count in (5, 1, 12)]
    theirs = [torch.nn.Parameter(torch.from_numpy(weights.astype(np.float64))) for weights in ours]
    before = np.concatenate(ours)
    adam, reference = Adam(ours, learning_rate), torch.optim.Adam(theirs, learning_rate)
    for number in range(100):
        gradients = rng.normal(size=18) * 10.0 ** -(number % 7)
        gradients[3] = 0
        adam.step(gradients)
        for weights, part in zip(theirs, np.split(gradients, [5, 6])):
            weights.grad = torch.from_numpy(part.copy())
        reference.step()
    after, expected = np.concatenate(ours), torch.cat(list(theirs)).detach().numpy()
    assert np.abs(after - expected).max() < 1e-5 < np.abs(after - before).max()
    assert after[3] == before[3]


def test_a_gradient_as_small_as_epsilon_moves_a_weight_by_half_as_much():
    """A constant gradient g moves a weight by g / (|g| + 1e-8) of the learning rate."""
    weights = np.zeros(4, np.float32)
    adam = Adam([weights], 0.01)
    for _ in range(3):
        adam.step(np.array([1.0, 1e-8, -3e-8, 0.0]))
    assert weights == pytest.approx([-0.03, -0.015, 0.0225, 0], rel=1e-5)
