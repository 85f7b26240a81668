"""The permutation-equivariant ("PEQ") network (Sec. III-G, Fig. 7)."""

import torch
from torch import nn

from unload import checks


class PEQNetwork(nn.Module):
    """Scores each item from its own features and the features of all (Fig. 7).

    Learnable feature extractor: n features of each item, ReLU. Global relation extractor:
    minimum, maximum and mean of each feature over the items. Relation scorer: one linear
    unit on the item's features beside the global ones, tanh. The same weights serve every
    item, so permuting the items permutes the scores, and any number of items will do.

    The paper's 1D convolutions, whose kernel covers one item, are linear layers on the
    last axis.

    Args:
        n_features: n; the paper does not give it. 4 n + 4 n + 1 parameters.
        generator: source of the initial weights, PyTorch's default one if None.
    """

    def __init__(self, n_features: int = 64, generator: torch.Generator | None = None) -> None:
        super().__init__()
        self.n_features = checks.integer("n_features", n_features, 1)
        self.extractor = nn.Linear(3, n_features)
        self.scorer = nn.Linear(4 * n_features, 1)
        if generator is not None:
            self.reset_parameters(generator)

    def reset_parameters(self, generator: torch.Generator) -> None:
        """Draw the weights as ``nn.Linear`` does, U(±1/√inputs), from ``generator``."""
        for layer in (self.extractor, self.scorer):
            bound = layer.in_features**-0.5
            nn.init.uniform_(layer.weight, -bound, bound, generator=generator)
            nn.init.uniform_(layer.bias, -bound, bound, generator=generator)

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Action values.

        Args:
            observations: (batch, items, 3) of the weights' dtype, float32.

        Returns:
            (batch, items), of the same dtype, in [-1, 1].

        Raises:
            TypeError: no tensor, or another dtype.
            ValueError: another shape, or no items.
        """
        if not isinstance(observations, torch.Tensor):
            raise TypeError(f"observations is a {type(observations).__name__}; expected a tensor")
        dtype = next(self.parameters()).dtype
        if observations.dtype != dtype:
            raise TypeError(f"observations has dtype {observations.dtype}; expected {dtype}")
        if observations.ndim != 3 or observations.shape[1] == 0 or observations.shape[2] != 3:
            raise ValueError(
                f"observations has shape {tuple(observations.shape)}; "
                "expected (batch, items, 3) with at least one item"
            )
        features = torch.relu(self.extractor(observations))  # (batch, items, n)
        context = torch.cat(  # (batch, 3 n)
            [features.amin(dim=1), features.amax(dim=1), features.mean(dim=1)], dim=1
        )
        context = context.unsqueeze(1).expand(-1, features.shape[1], -1)
        enhanced = torch.cat([features, context], dim=2)  # (batch, items, 4 n)
        return torch.tanh(self.scorer(enhanced)).squeeze(2)
