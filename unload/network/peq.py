"""The permutation-equivariant ("PEQ") network (Sec. III-G, Fig. 7)."""

import torch
from torch import nn

from unload.support import checks


class ScoringNetwork(nn.Module):
    """Base of networks that score each item by one linear unit, tanh.

    A subclass takes the arguments of ``PEQNetwork``, makes its layers, among them ``scorer``, and
    defines ``features``.
    """

    scorer: nn.Linear

    def __init__(self, n_features: int) -> None:
        super().__init__()
        self.n_features = checks.integer("n_features", n_features, 1)

    def reset_parameters(self, generator: torch.Generator | None = None) -> None:
        """Draw the weights and biases from U(±1/√inputs), as ``nn.Linear`` does."""
        for module in self.modules():
            weights = list(module.parameters(recurse=False))
            if weights and weights[0].ndim == 2:  # normalizations begin as ones and zeros
                bound = weights[0].shape[1] ** -0.5
                for weight in weights:
                    nn.init.uniform_(weight, -bound, bound, generator=generator)

    def forward(
        self, observations: torch.Tensor, present: torch.Tensor | None = None
    ) -> torch.Tensor:
        """Action values.

        Args:
            observations: (batch, items, 3) of the weights' dtype, float32.
            present: (batch, items) bool, the rows that hold an item; all if None. The others have
                no influence on these. In an observation without any item, all rows count.

        Returns:
            (batch, items), of the same dtype, in [-1, 1]. Where a row holds no item, the
            value is finite but means nothing.
        """
        if present is not None:
            present = present | ~present.any(dim=1, keepdim=True)  # the maximum of none is infinite
        return torch.tanh(self.scorer(self.features(observations, present))).squeeze(2)

    def features(self, observations: torch.Tensor, present: torch.Tensor | None) -> torch.Tensor:
        """Features of each item that the scorer reads, (batch, items, its inputs)."""
        raise NotImplementedError


class PEQNetwork(ScoringNetwork):
    """Scores each item from its own features and the features of all (Fig. 7).

    Learnable feature extractor: n features of each item, ReLU. Global relation extractor:
    minimum, maximum and mean of each feature over the items. Relation scorer: one linear
    unit on the item's features beside the global ones, tanh. The same weights serve every
    item, so permuting the items permutes the scores, and any number of items will do. Rows
    that hold no item can be left out of the global features.

    The paper's 1D convolutions, whose kernel covers one item, are linear layers on the
    last axis.

    Args:
        n_features: n, at least 1; the paper does not give it. 4 n + 4 n + 1 parameters.
        generator: source of the initial weights, PyTorch's default one if None.
    """

    def __init__(self, n_features: int = 64, generator: torch.Generator | None = None) -> None:
        super().__init__(n_features)
        self.extractor = nn.Linear(3, n_features)
        self.scorer = nn.Linear(4 * n_features, 1)
        if generator is not None:  # PyTorch's own weights are drawn in the same way
            self.reset_parameters(generator)

    def features(self, observations: torch.Tensor, present: torch.Tensor | None) -> torch.Tensor:
        own = torch.relu(self.extractor(observations))  # (batch, items, n)
        context = torch.cat(pooled(own, present), dim=1).unsqueeze(1)  # (batch, 1, 3 n)
        return torch.cat([own, context.expand(-1, own.shape[1], -1)], dim=2)


def pooled(features: torch.Tensor, present: torch.Tensor | None) -> list[torch.Tensor]:
    """Minimum, maximum and mean over the rows that hold an item, (batch, n) each."""
    if present is None:
        return [features.amin(dim=1), features.amax(dim=1), features.mean(dim=1)]
    absent = ~present.unsqueeze(2)  # (batch, items, 1)
    return [
        features.masked_fill(absent, torch.inf).amin(dim=1),
        features.masked_fill(absent, -torch.inf).amax(dim=1),
        features.masked_fill(absent, 0).sum(dim=1) / present.sum(dim=1, keepdim=True),
    ]
