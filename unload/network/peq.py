"""The permutation-equivariant ("PEQ") network (Sec. III-G, Fig. 7)."""

import torch
from torch import nn

from unload.support import checks


class PEQNetwork(nn.Module):
    """Scores each item from its own features and the features of all (Fig. 7).

    Learnable feature extractor: n features of each item, ReLU. Global relation extractor:
    minimum, maximum and mean of each feature over the items. Relation scorer: one linear
    unit on the item's features beside the global ones, tanh. The same weights serve every
    item, so permuting the items permutes the scores, and any number of items will do. Rows
    that hold no item can be left out of the global features.

    The paper's 1D convolutions, whose kernel covers one item, are linear layers on the
    last axis.

    Args:
        n_features: n; the paper does not give it. 4 n + 4 n + 1 parameters.
        generator: source of the initial weights, PyTorch's default one if None.

    Raises:
        TypeError: ``n_features`` is not an integer.
        ValueError: ``n_features`` is less than 1.
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

    def forward(
        self, observations: torch.Tensor, present: torch.Tensor | None = None
    ) -> torch.Tensor:
        """Action values.

        Args:
            observations: (batch, items, 3) of the weights' dtype, float32.
            present: (batch, items) bool, the rows that hold an item; all if None. The global
                features are those of these rows alone, and 0 where there is none.

        Returns:
            (batch, items), of the same dtype, in [-1, 1]. Where a row holds no item, the
            value is finite but means nothing.

        Raises:
            TypeError: no tensor, or another dtype.
            ValueError: another shape, or no rows.
        """
        check_observations(observations, next(self.parameters()).dtype)
        if present is not None:
            check_present(present, observations)
        features = torch.relu(self.extractor(observations))  # (batch, items, n)
        context = torch.cat(pooled(features, present), dim=1)  # (batch, 3 n)
        context = context.unsqueeze(1).expand(-1, features.shape[1], -1)
        enhanced = torch.cat([features, context], dim=2)  # (batch, items, 4 n)
        return torch.tanh(self.scorer(enhanced)).squeeze(2)


def check_observations(observations: torch.Tensor, dtype: torch.dtype) -> None:
    """Raise unless ``observations`` is (batch, items, 3) of this ``dtype``, of some items."""
    if not isinstance(observations, torch.Tensor):
        raise TypeError(f"observations is a {type(observations).__name__}; expected a tensor")
    if observations.dtype != dtype:
        raise TypeError(f"observations has dtype {observations.dtype}; expected {dtype}")
    if observations.ndim != 3 or observations.shape[1] == 0 or observations.shape[2] != 3:
        raise ValueError(
            f"observations has shape {tuple(observations.shape)}; "
            "expected (batch, items, 3) with at least one item"
        )


def check_present(present: torch.Tensor, observations: torch.Tensor) -> None:
    """Raise unless ``present`` is bool, one per row of ``observations``."""
    if not isinstance(present, torch.Tensor):
        raise TypeError(f"present is a {type(present).__name__}; expected a tensor")
    if present.dtype != torch.bool:
        raise TypeError(f"present has dtype {present.dtype}; expected torch.bool")
    if present.shape != observations.shape[:2]:
        raise ValueError(
            f"present has shape {tuple(present.shape)}; expected {tuple(observations.shape[:2])}"
        )


def pooled(features: torch.Tensor, present: torch.Tensor | None) -> list[torch.Tensor]:
    """Minimum, maximum and mean over the rows that hold an item, (batch, n) each."""
    if present is None:
        return [features.amin(dim=1), features.amax(dim=1), features.mean(dim=1)]
    absent = ~present.unsqueeze(2)  # (batch, items, 1)
    count = present.sum(dim=1, keepdim=True)  # (batch, 1)
    values = [
        features.masked_fill(absent, torch.inf).amin(dim=1),
        features.masked_fill(absent, -torch.inf).amax(dim=1),
        features.masked_fill(absent, 0).sum(dim=1) / count.clamp(min=1),
    ]
    return [each.masked_fill(count == 0, 0) for each in values]
