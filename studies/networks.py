"""Networks more expressive than the paper's (Sec. V-A, "Network architecture").

Their input and output are those of ``PEQNetwork``. They are permutation-equivariant, too: the
same weights serve every item, so permuting the items permutes the values. They have no compiled
twin, and take padded rows for items in training.
"""

import torch
from torch import nn
from torch.nn.functional import linear

from unload.network.peq import ScoringNetwork, pooled


class TwoLayerScorer(ScoringNetwork):
    """The paper's network with a hidden layer in its relation scorer.

    In the paper's one linear unit, the global features shift the scores of all items by the
    same amount, so the choice does not depend on them. With a hidden layer of n units, it does.
    """

    def __init__(self, n_features: int = 64, generator: torch.Generator | None = None) -> None:
        super().__init__(n_features)
        self.scorer = nn.Linear(n_features, 1)
        self.extractor = nn.Linear(3, n_features)
        self.hidden = nn.Linear(4 * n_features, n_features)
        self.reset_parameters(generator)

    def features(self, observations: torch.Tensor, present: torch.Tensor | None) -> torch.Tensor:
        own = torch.relu(self.extractor(observations))
        context = torch.cat(pooled(own, present), dim=1)
        return torch.relu(linear_with_context(self.hidden, own, context))


class EquivariantStack(ScoringNetwork):
    """Three equivariant layers (Zaheer et al., Deep Sets, 2017).

    Each takes an item's own features beside the maximum of each feature over the items, and
    gives n features, ReLU.
    """

    def __init__(self, n_features: int = 64, generator: torch.Generator | None = None) -> None:
        super().__init__(n_features)
        self.scorer = nn.Linear(n_features, 1)
        self.layers = nn.ModuleList(
            nn.Linear(2 * inputs, n_features) for inputs in (3, n_features, n_features)
        )
        self.reset_parameters(generator)

    def features(self, observations: torch.Tensor, present: torch.Tensor | None) -> torch.Tensor:
        own = observations
        for layer in self.layers:
            there = own if present is None else own.masked_fill(~present.unsqueeze(2), -torch.inf)
            context = there.amax(dim=1)
            own = torch.relu(linear_with_context(layer, own, context))  # type: ignore[arg-type]
        return own


NETWORKS = {  # by their names in published settings
    "two_layer": TwoLayerScorer,
    "stack": EquivariantStack,
}


def linear_with_context(layer: nn.Linear, own: torch.Tensor, context: torch.Tensor) -> torch.Tensor:
    """Apply a layer to (batch, items, n) own features beside the (batch, m) that all share."""
    # The context's share of the sum is computed once per observation instead of once per item.
    for_own, for_context = layer.weight.split([own.shape[2], context.shape[1]], dim=1)
    return linear(own, for_own, layer.bias) + linear(context, for_context).unsqueeze(1)
