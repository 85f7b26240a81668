"""Memory of past picks to learn from."""

from typing import Any

import numpy as np


class ReplayBuffer:
    """The last ``size`` picks, in arrays.

    What follows a pick is kept only if it is needed: with gamma = 0 the target is the
    reward alone (Sec. III-E). The operating system gives the arrays memory as they are filled.

    Args:
        size: number of picks kept; older ones are overwritten.
        items: items per observation.
        next_state: keep the observation and mask after each pick, and whether the task
            ended there.

    Attributes:
        arrays: name → array whose first axis is the slot. ``observations`` (size, items, 3)
            float32; ``actions`` (size,) int64, ``rewards`` (size,) float32; with
            ``next_state`` also ``next_observations`` (size, items, 3) float32,
            ``next_masks`` (size, items) bool and ``terminations`` (size,) bool.
        total: picks ever added.
    """

    def __init__(self, size: int, items: int, next_state: bool = False) -> None:
        self.size, self.total = size, 0
        self.arrays: dict[str, np.ndarray] = {
            "observations": np.empty((size, items, 3), np.float32),
            "actions": np.empty(size, np.int64),
            "rewards": np.empty(size, np.float32),
        }
        if next_state:
            self.arrays |= {
                "next_observations": np.empty((size, items, 3), np.float32),
                "next_masks": np.empty((size, items), bool),
                "terminations": np.empty(size, bool),
            }

    def __len__(self) -> int:
        return min(self.total, self.size)

    def add(self, **batch: np.ndarray) -> None:
        """Add a batch of picks; the names are those of ``arrays``, the first axis the batch."""
        count = len(batch["actions"])
        slots = np.arange(self.total, self.total + count) % self.size
        for name, array in self.arrays.items():
            array[slots] = batch[name]
        self.total += count

    def state_dict(self) -> dict[str, Any]:
        """Return what is filled of the arrays, without a copy, for a checkpoint."""
        arrays = {name: array[: len(self)] for name, array in self.arrays.items()}
        return {"total": self.total, "arrays": arrays}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Take back what ``state_dict`` returned."""
        self.total = state["total"]
        for name, array in self.arrays.items():
            array[: len(self)] = state["arrays"][name]
