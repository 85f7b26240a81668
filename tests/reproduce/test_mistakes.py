import numpy as np
import pytest
import torch

import unload
from unload.reproduce.mistakes import mistakes
from unload.support import files


def test_a_policy_without_a_mistake():
    found = mistakes(unload.policies.highest, 4, 0)
    assert found["failed"] == found["first_failed"] == 0
    assert np.isnan(found[["repeated", "value_failed"]]).all()


def test_a_blocked_favourite_fails_every_second_pick():
    """The lowest item fails, the highest does not, and the mask is cleared in between."""

    def lowest_then_highest(observations, masks, rng):
        heights = observations[:, :, 2]
        lowest = heights.argmin(axis=1)
        allowed = masks[np.arange(len(masks)), lowest]
        return np.where(allowed, lowest, heights.argmax(axis=1))

    found = mistakes(lowest_then_highest, 4, 0)
    assert found["failed"] == pytest.approx(0.5, abs=0.01)
    assert found["first_failed"] == pytest.approx(1, abs=0.01)
    assert found["repeated"] > 0.5


def test_it_agrees_with_evaluate():
    policy = unload.load_policy(files.DATA / "answer" / "paper_mask" / "seed_4.safetensors")
    msr = unload.evaluate(policy, 3, 5)["success_rate"].mean()
    found = mistakes(policy, 3, 5)
    assert 0.1 < found["failed"] == pytest.approx(1 - msr, abs=1 / 500)  # but for the last pick
    assert found["first_failed"] < found["failed"]


def test_the_value_of_what_fails():
    """A network that likes low items: most fail, and the lowest ones get the highest values."""
    network = unload.PEQNetwork(n_features=1)
    with torch.no_grad():
        for weights in network.parameters():
            weights.zero_()
        network.extractor.weight[0, 2] = -1
        network.scorer.weight[0, 0] = 1
        network.scorer.bias.fill_(0.5)
    found = mistakes(unload.Greedy(network, equalize=True), 2, 0)
    assert found["failed"] > 0.5
    assert np.tanh(0.5) < found["value_failed"] <= np.tanh(1.5)


def test_bad_arguments_are_refused():
    with pytest.raises(ValueError, match="episodes is 0"):
        mistakes(unload.policies.highest, 0, 0)
    with pytest.raises(ValueError, match="seed is -1"):
        mistakes(unload.policies.highest, 1, -1)
