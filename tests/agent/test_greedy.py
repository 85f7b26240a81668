import numpy as np
import pytest
import torch

from tests.agent.networks import peq
from unload import Greedy, equalize
from unload.agent.greedy import greedy_actions
from unload.agent.learner import highest_values
from unload.env.observation import PADDING
from unload.network.variants import NETWORKS


@pytest.fixture
def observations(rng) -> np.ndarray:
    return rng.uniform(-1, 1, (40, 25, 3)).astype(np.float32)


def test_greedy_actions_are_those_of_the_highest_value(rng):
    network = peq()
    observations = rng.uniform(-1, 1, (100, 30, 3)).astype(np.float32)
    masks = rng.integers(2, size=(100, 30)).astype(bool)
    masks[:, 0] = True
    values = network(torch.from_numpy(observations)).detach().numpy()
    chosen = greedy_actions(network, observations, masks)
    best = np.where(masks, values, -np.inf).max(axis=1)
    assert masks[np.arange(100), chosen].all()
    assert values[np.arange(100), chosen] == pytest.approx(best, abs=1e-6)


def test_greedy_equalizes_what_its_network_expects(observations, rng):
    masks = np.ones(observations.shape[:2])
    for ties in ("noise", "average"):
        policy = Greedy(peq(), equalize=True, ties=ties)
        expected = greedy_actions(policy.network, equalize(observations, ties), masks)
        assert (policy(observations, masks, rng) == expected).all()
    raw = Greedy(peq(), equalize=False)(observations, masks, rng)
    assert (raw == greedy_actions(peq(), observations, masks)).all()
    assert (raw != expected).any()


@pytest.mark.parametrize("equalized", [True, False])
def test_values_are_those_of_the_network(observations, equalized):
    network = peq()
    seen = equalize(observations).astype(np.float32) if equalized else observations
    expected = network(torch.from_numpy(seen)).detach().numpy()
    assert (Greedy(network, equalized).values(observations.astype(float)) == expected).all()
    with pytest.raises(ValueError, match="observations"):
        Greedy(network, equalized).values(observations[0])


@pytest.mark.parametrize("name", [name for name in NETWORKS if name != "peq"])
def test_rows_without_an_item_have_no_part_in_the_choice(observations, name, rng):
    network = NETWORKS[name](16, torch.Generator().manual_seed(2))
    masks = np.ones((len(observations), 25))
    full = Greedy(network, equalize=False)(observations, masks, rng)
    few = network(torch.from_numpy(observations[:, :4])).argmax(dim=1).numpy()
    observations[:, 4:], masks[:, 4:] = PADDING, 0
    assert (Greedy(network, equalize=False)(observations, masks, rng) == few).all()
    with_padding = highest_values(network, observations, masks.astype(bool))
    assert (with_padding != few).any() and (full != few).any()


@pytest.mark.parametrize("name", NETWORKS)
def test_weights_that_are_not_finite_choose_nothing(observations, name):
    """They once picked row 0 without a word."""
    network = NETWORKS[name](4, torch.Generator().manual_seed(0))
    allowed = np.ones(observations.shape[:2], bool)
    torch.nn.init.constant_(network.scorer.weight, torch.nan)
    for choose in (greedy_actions, highest_values):
        with pytest.raises(FloatingPointError, match="row 0 has no allowed action of a finite"):
            choose(network, observations, allowed)


@pytest.mark.parametrize("value", [torch.nan, torch.inf])
@pytest.mark.parametrize("layer", ["extractor", "scorer"])
def test_one_weight_that_is_not_finite_is_enough(observations, value, layer):
    """The compiled choice once took row 0, or passed over the items that it spoiled."""
    network = peq()
    with torch.no_grad():
        getattr(network, layer).weight[0, 0] = value
    with pytest.raises(FloatingPointError, match="has no allowed action of a finite value"):
        greedy_actions(network, observations, np.ones(observations.shape[:2], bool))
