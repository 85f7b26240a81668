import numpy as np
import pytest
import torch
from torch.nn.functional import smooth_l1_loss

from tests.agent.runs import make_batch, peq
from unload.agent.learner import ROWS_PER_PASS, PlainLearner
from unload.fast.learner import FusedLearner

SIZE, ITEMS = ROWS_PER_PASS + 30, 9  # more than one chunk


@pytest.fixture
def batch(rng) -> dict[str, np.ndarray]:
    return make_batch(rng, SIZE, ITEMS)


def test_gradients_are_those_of_the_mean_loss(rng, batch):
    """Adam hides a constant factor, so the gradients themselves are compared."""
    targets = rng.uniform(-1, 1, SIZE).astype(np.float32)
    learner, reference = PlainLearner(peq(), 1e-3, 0.5), peq()
    loss = learner.start(batch, targets)()
    values = reference(torch.from_numpy(batch["observations"]))
    chosen = values[torch.arange(SIZE), torch.from_numpy(batch["actions"])]
    expected = smooth_l1_loss(chosen, torch.from_numpy(targets), beta=0.5)
    expected.backward()
    assert loss == pytest.approx(expected.item(), rel=1e-6)
    for mine, theirs in zip(learner.network.parameters(), reference.parameters()):
        assert torch.allclose(mine.grad, theirs.grad, rtol=1e-4, atol=1e-8)


@pytest.mark.parametrize("kind", [PlainLearner, FusedLearner])
def test_the_fused_update_takes_tanh_in_double_precision(batch, kind):
    """Where the value is nearly 1, the slope of tanh in single precision is 0."""
    saturated = peq()
    with torch.no_grad():
        saturated.scorer.bias.fill_(12.0)
    learner = kind(saturated, 1e-3, 1.0)
    for _ in range(3):
        learner.start(batch, np.full(SIZE, -1, np.float32))()
    assert (saturated.scorer.bias.item() < 12) == (kind is FusedLearner)
