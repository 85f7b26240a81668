"""The greedy choice among the allowed items, and the policy of a trained network."""

import numpy as np
import torch

from unload.agent.fast import fused
from unload.agent.policies import check_batch
from unload.env.equalization import TIES, equalize
from unload.env.observation import holds_item
from unload.support import checks


def check_network(network: torch.nn.Module) -> torch.nn.Module:
    if not isinstance(network, torch.nn.Module):
        raise TypeError(f"network is {network!r}; expected a torch.nn.Module")
    return network


def greedy_actions(
    network: torch.nn.Module,
    observations: np.ndarray,
    masks: np.ndarray,
    present: np.ndarray | None = None,
) -> np.ndarray:
    """The allowed action of the highest value, (batch,) int64.

    ``present``: (batch, items) bool, the rows that hold an item; all if None.
    """
    return best_actions(network, *check_batch(observations, masks), present)


@torch.no_grad()
def best_actions(
    network: torch.nn.Module,
    observations: np.ndarray,
    allowed: np.ndarray,
    present: np.ndarray | None = None,
) -> np.ndarray:
    """``greedy_actions`` on what ``check_batch`` has returned."""
    if fused.applies(network):  # the item's own features decide, whatever else there is
        observations = observations.astype(np.float32, copy=False)
        return fused.greedy_actions(fused.weights_of(network), observations, allowed)
    arguments = [torch.as_tensor(observations, dtype=torch.float32)]
    if present is not None and not present.all():  # other modules need not know of padding
        arguments.append(torch.from_numpy(present))
    values = network(*arguments)
    return values.masked_fill(torch.from_numpy(~allowed), -torch.inf).argmax(dim=1).numpy()


class Greedy:
    """The policy of a trained network: the allowed item of the highest value.

    Called like the functions of ``unload.policies``, on observations that are not
    equalized; it equalizes them itself if the network was trained so.

    Args:
        network: the trained network.
        equalize: whether the network expects equalized observations.
        ties: see ``unload.equalize``.
    """

    def __init__(self, network: torch.nn.Module, equalize: bool, ties: str = "noise") -> None:
        self.network = check_network(network).eval()
        self.equalize = checks.boolean("equalize", equalize)
        checks.one_of("ties", ties, TIES)
        self.ties = ties

    def __call__(
        self, observations: np.ndarray, masks: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        present = holds_item(observations)
        if self.equalize:
            observations = equalize(observations, self.ties, present=present)
        return greedy_actions(self.network, observations, masks, present)
