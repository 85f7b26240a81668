"""Networks more expressive than the paper's; what holds for that one holds for them, too."""

import pytest
import torch

from studies.networks import NETWORKS, EquivariantStack, TwoLayerScorer
from tests.network.test_peq import (  # noqa: F401
    make,
    test_bad_numbers_of_features_are_refused,
    test_permuting_the_items_permutes_the_values,
    test_the_generator_alone_decides_the_weights,
    test_values_and_gradients_are_finite_where_there_is_no_item,
    test_weights_are_drawn_from_plus_minus_one_over_root_inputs,
    test_what_absent_rows_hold_has_no_influence,
)


@pytest.fixture(params=NETWORKS.values())
def kind(request) -> type:
    return request.param


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
