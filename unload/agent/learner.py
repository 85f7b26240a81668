"""The update of a deep Q-network in plain PyTorch (Sec. II-B and III-G).

This is the version to read first. ``unload.fast.learner`` does the same for the paper's
network on a CPU, some sixty times faster on one core; a test holds the two equal.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import torch
from torch.nn.functional import smooth_l1_loss

from unload.network.weights import as_arrays, as_tensors

# Rows of a batch per backward pass, because what a pass stores then stays in the cache.
ROWS_PER_PASS = 64


class PlainLearner:
    """Fits a network's values of chosen actions to their targets, with Adam.

    Args:
        network: (batch, items, 3) → (batch, items) action values; changed in place.
        learning_rate: of Adam.
        beta: threshold of the smooth-L1 loss.
    """

    def __init__(self, network: torch.nn.Module, learning_rate: float, beta: float) -> None:
        self.network, self.beta = network, beta
        self.optimizer = torch.optim.Adam(network.parameters(), learning_rate)

    def state_dict(self) -> dict[str, Any]:
        """Return the optimizer's state, with arrays for tensors, for a checkpoint."""
        return as_arrays(self.optimizer.state_dict())

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Take back what ``state_dict`` returned."""
        moments = {int(number): as_tensors(each) for number, each in state["state"].items()}
        groups = self.optimizer.param_groups
        self.optimizer.load_state_dict(as_tensors(state) | {"state": moments})
        # Settings are put back in place, because a scheduler may hold them.
        for group, loaded in zip(groups, self.optimizer.param_groups):
            group.update(loaded)
        self.optimizer.param_groups = groups

    def best_actions(self, observations: np.ndarray, allowed: np.ndarray) -> np.ndarray:
        """Return the allowed action of the highest value, (batch,) int64."""
        return best_actions(self.network, observations, allowed)

    def start(
        self, batch: dict[str, np.ndarray], targets: np.ndarray, rows: np.ndarray | None = None
    ) -> Callable[[], float]:
        """Return the update as a function that carries it out and returns the loss before it.

        Args:
            batch: ``observations`` (k, items, 3) float32 and ``actions`` (k,) int64.
            targets: (k,) float32.
            rows: which of the k rows to learn from, int64; all if None.
        """
        arrays = [batch["observations"], batch["actions"], targets]
        if rows is not None:
            arrays = [array.take(rows, axis=0) for array in arrays]
        return partial(self._update, *map(torch.from_numpy, arrays))

    def _update(
        self, observations: torch.Tensor, actions: torch.Tensor, targets: torch.Tensor
    ) -> float:
        self.optimizer.zero_grad()
        total = 0.0
        for start in range(0, len(targets), ROWS_PER_PASS):
            rows = slice(start, start + ROWS_PER_PASS)
            values = self.network(observations[rows])
            chosen = values.gather(1, actions[rows, None]).squeeze(1)
            loss = smooth_l1_loss(chosen, targets[rows], reduction="sum", beta=self.beta)
            (loss / len(targets)).backward()
            total += loss.item() / len(targets)
        if not np.isfinite(total):
            raise FloatingPointError(f"the loss is {total}; expected a finite number")
        for name, weight in self.network.named_parameters():
            if weight.grad is not None and not weight.grad.isfinite().all():
                raise FloatingPointError(f"the gradient of {name} is not finite; expected finite")
        self.optimizer.step()
        return total


@torch.no_grad()
def best_actions(
    network: torch.nn.Module,
    observations: np.ndarray,
    allowed: np.ndarray,
    present: np.ndarray | None = None,
) -> np.ndarray:
    """Return the allowed action of the highest value, in plain PyTorch.

    Args:
        network: (batch, items, 3) → (batch, items) action values.
        observations: (batch, items, 3) float32.
        allowed: (batch, items) bool, at least one per row.
        present: (batch, items) bool, the rows that hold an item; all if None.

    Returns:
        (batch,) int64.

    Raises:
        FloatingPointError: an allowed action has a value that is not finite.
    """
    arguments = [torch.from_numpy(observations)]
    if present is not None and not present.all():  # other modules need not know of padding
        arguments.append(torch.from_numpy(present))
    values, may_pick = network(*arguments), torch.from_numpy(allowed)
    wrong = (may_pick & ~values.isfinite()).any(dim=1)
    if wrong.any():
        raise FloatingPointError(
            f"row {int(wrong.int().argmax())} has an allowed action whose value is not finite; "
            "expected finite observations and weights"
        )
    return values.masked_fill(~may_pick, -torch.inf).argmax(dim=1).numpy()
