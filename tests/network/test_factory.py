import pytest
import torch

from tests.agent.runs import HeightNetwork
from unload.network.factory import make_network


def test_a_network_is_in_single_precision_whatever_pytorchs_default_is():
    torch.set_default_dtype(torch.float64)
    try:
        assert make_network("peq", 4).extractor.weight.dtype == torch.float32
        assert torch.get_default_dtype() == torch.float64
    finally:
        torch.set_default_dtype(torch.float32)


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
