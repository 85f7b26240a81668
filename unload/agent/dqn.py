"""The masked DQN agent (Sec. II-B and III-G)."""

from collections.abc import Callable
from typing import Any

import numpy as np
import torch

from unload.agent.learner import PlainLearner
from unload.agent.policies import any_allowed
from unload.fast import fused
from unload.fast.learner import FusedLearner
from unload.network.weights import as_arrays, as_tensors
from unload.support import checks


class DQN:
    """Deep Q-learning on masked actions, with a target network.

    What the caller's masks exclude counts nowhere: ``allowed`` is for exploration and for the
    greedy choice, ``next_masks`` of a batch for the maximum in the bootstrap target. What training
    excludes is said by ``TrainConfig.mask``.

    Args:
        network: (batch, items, 3) → (batch, items) action values.
        learning_rate: of Adam.
        gamma: discount factor; 0 in the paper (Sec. III-E), where the target is the
            reward alone and the target network is not asked.
        beta: threshold of the smooth-L1 loss (Sec. III-G); 1 in the paper.
        fused_update: choose and update by the compiled twin of plain PyTorch, see
            ``unload.fast``; wherever it applies if None.

    Attributes:
        learner: the ``PlainLearner`` or ``FusedLearner`` that chooses and updates.
        target: the target network's weights by name.
    """

    def __init__(
        self,
        network: torch.nn.Module,
        learning_rate: float = 1e-3,
        gamma: float = 0.0,
        beta: float = 1.0,
        fused_update: bool | None = None,
    ) -> None:
        self.network = checks.instance("network", network, torch.nn.Module, "a torch.nn.Module")
        applies = fused.applies(network)
        if fused_update is None:
            fused_update = applies
        if checks.boolean("fused_update", fused_update) and not applies:
            raise ValueError(
                "fused_update is True; expected a PEQNetwork in float32 on the CPU with it"
            )
        self.gamma = checks.real("gamma", gamma, 0, 1)
        # Names of the arrays of a batch that an update reads.
        self._needed: tuple[str, ...] = ("observations", "actions", "rewards")
        if self.gamma > 0:
            self._needed += "next_observations", "next_masks", "terminations"
        settings = checks.real("learning_rate", learning_rate, 0), checks.real("beta", beta, 0)
        kind: Any = FusedLearner if fused_update else PlainLearner
        self.learner: FusedLearner | PlainLearner = kind(network, *settings)
        self.update_target()

    def choose(
        self,
        observations: np.ndarray,
        allowed: np.ndarray,
        epsilon: float,
        rng: np.random.Generator,
    ) -> np.ndarray:
        """Choose actions ε-greedily.

        Args:
            observations: (batch, items, 3) float.
            allowed: (batch, items) bool, where an item may be picked.
            epsilon: probability of a random allowed action.
            rng: draws who explores, and what.

        Returns:
            (batch,) int64.
        """
        checks.shaped("observations", observations, (None, None, 3))
        checks.shaped("allowed", allowed, observations.shape[:2])
        explore = rng.random(len(observations)) < epsilon
        exploit = ~explore
        actions = np.empty(len(observations), np.int64)
        actions[explore] = any_allowed(allowed[explore], rng)
        if exploit.any():
            seen = observations[exploit].astype(np.float32, copy=False)
            actions[exploit] = self.learner.best_actions(seen, allowed[exploit])
        return actions

    def update(self, batch: dict[str, np.ndarray], rows: np.ndarray | None = None) -> float:
        """Take one step of Adam.

        Args:
            batch: arrays as those of a ``ReplayBuffer``.
            rows: (batch,) int64, which rows of the arrays to learn from; all if None.

        Returns:
            The loss before the step.

        Raises:
            TypeError, ValueError: ``batch`` is no dict, an array is missing or not as described,
                or a next state that is not terminal allows no action.
            FloatingPointError: the loss is not finite; the weights are left as they were.
        """
        checks.entries("batch", batch, self._needed)
        observations, actions = batch["observations"], batch["actions"]
        checks.shaped("observations", observations, (None, None, 3), np.dtype(np.float32))
        count, items = observations.shape[:2]
        checks.shaped("actions", actions, (count,), np.dtype(np.int64))
        checks.shaped("rewards", batch["rewards"], (count,), np.dtype(np.float32))
        if self.gamma > 0:
            following = batch["next_observations"]
            checks.shaped("next_observations", following, observations.shape, np.dtype(np.float32))
            checks.shaped("next_masks", batch["next_masks"], (count, items), np.dtype(bool))
            checks.shaped("terminations", batch["terminations"], (count,), np.dtype(bool))
        rows = np.arange(count) if rows is None else rows
        rows = checks.integer_array("rows", rows, (None,), count - 1)
        if not rows.size:
            raise ValueError("rows is empty; expected at least one")
        checks.integer_array("actions", actions[rows], (None,), items - 1)
        return self.start_update(batch, rows)()

    def start_update(
        self, batch: dict[str, np.ndarray], rows: np.ndarray | None = None
    ) -> Callable[[], float]:
        """Begin an ``update`` whose arrays need no check, as those of a ``ReplayBuffer``.

        The fused one goes on in other threads while the calling thread acts.

        Returns:
            A function that completes the update, returns the loss and may raise as ``update``
            does. The weights stay as they are until it is called, and so must the arrays.
        """
        if self.gamma == 0:
            return self.learner.start(batch, batch["rewards"], rows)
        if rows is not None:
            batch = {name: batch[name].take(rows, axis=0) for name in self._needed}
        return self.learner.start(batch, self._targets(batch))

    @torch.no_grad()
    def _targets(self, batch: dict[str, np.ndarray]) -> np.ndarray:
        """r + γ max over the allowed actions of the target network, (batch,) float32."""
        no_action = ~batch["next_masks"].any(axis=1) & ~batch["terminations"]
        if no_action.any():
            row = int(np.argmax(no_action))
            raise ValueError(
                f"next_masks is all zero in row {row}, which is not terminal; "
                "expected at least one allowed action"
            )
        following = torch.from_numpy(batch["next_observations"])
        values = torch.func.functional_call(self.network, self.target, (following,))
        best = values.masked_fill(torch.from_numpy(~batch["next_masks"]), -torch.inf).amax(dim=1)
        best = best.masked_fill(torch.from_numpy(batch["terminations"]), 0)
        return (torch.from_numpy(batch["rewards"]) + self.gamma * best).numpy()

    def state_dict(self) -> dict[str, Any]:
        """Return both networks' weights and the learner's state, as arrays, for a checkpoint."""
        weights = {"network": self.network.state_dict(), "target": self.target}
        return as_arrays(weights) | {"learner": self.learner.state_dict()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Take back what ``state_dict`` returned."""
        self.network.load_state_dict(as_tensors(state["network"]))
        self.target = as_tensors(state["target"])
        self.learner.load_state_dict(state["learner"])

    def update_target(self) -> None:
        """Copy the network's weights to the target network."""
        self.target = {name: value.clone() for name, value in self.network.state_dict().items()}

    def check_finite(self) -> None:
        """Raise FloatingPointError unless all weights are finite."""
        for name, value in self.network.state_dict().items():
            if not value.isfinite().all():
                raise FloatingPointError(f"{name} is not finite; expected finite weights")
