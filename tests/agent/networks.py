"""Small networks, and a policy that picks badly, for several tests."""

import numpy as np
import torch

from unload import PEQNetwork


class HeightNetwork(torch.nn.Module):
    """Values each item by its z, times a weight."""

    def __init__(self, weight: float | torch.Tensor = 1.0) -> None:
        super().__init__()
        self.weight = torch.nn.Parameter(torch.as_tensor(weight))

    def forward(self, observations: torch.Tensor, present=None) -> torch.Tensor:
        return observations[..., 2] * self.weight


def peq(seed: int = 0, n_features: int = 8) -> PEQNetwork:
    return PEQNetwork(n_features, torch.Generator().manual_seed(seed))


def weights(network: torch.nn.Module) -> list[torch.Tensor]:
    return [parameter.detach().clone() for parameter in network.parameters()]


def lowest(observations: np.ndarray, masks: np.ndarray, rng) -> np.ndarray:
    """A policy that goes for the lowest item, which has others on it."""
    return np.where(masks, observations[..., 2], np.inf).argmin(axis=1)
