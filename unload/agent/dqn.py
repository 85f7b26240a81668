"""The masked DQN agent (Sec. II-B and III-G), and the greedy policy it leaves behind."""

from collections.abc import Callable
from functools import partial

import numpy as np
import torch
from torch.nn.functional import smooth_l1_loss

from unload.agent.fast import fused
from unload.agent.fast.adam import Adam
from unload.agent.greedy import best_actions, check_network
from unload.agent.policies import any_allowed, check_batch
from unload.support import checks

# Rows of a batch per backward pass: what one pass stores stays in the cache.
CHUNK = 64


class DQN:
    """Deep Q-learning on masked actions, with a target network.

    The mask acts wherever an action is chosen: in exploration, in the greedy choice and
    in the maximum of the bootstrap target.

    Args:
        network: (batch, items, 3) → (batch, items) action values.
        learning_rate: of Adam.
        gamma: discount factor; 0 in the paper (Sec. III-E), where the target is the
            reward alone and the target network is not asked.
        beta: threshold of the smooth-L1 loss (Sec. III-G); 1 in the paper.
        fused_update: update by ``unload.fused`` and ``unload.adam`` instead of PyTorch; wherever
            it applies if None.

    Raises:
        TypeError, ValueError: an argument is not as described, or ``fused_update`` is asked
            for and does not apply.
    """

    def __init__(
        self,
        network: torch.nn.Module,
        learning_rate: float = 1e-3,
        gamma: float = 0.0,
        beta: float = 1.0,
        fused_update: bool | None = None,
    ) -> None:
        self.network = check_network(network)
        if fused_update is None:
            fused_update = fused.applies(network)
        self.fused_update = checks.boolean("fused_update", fused_update)
        if self.fused_update and not fused.applies(network):
            raise ValueError(
                "fused_update is True; expected a PEQNetwork in float32 on the CPU with it"
            )
        self.gamma = checks.real("gamma", gamma, 0, 1)
        self.beta = checks.real("beta", beta, 0)
        learning_rate = checks.real("learning_rate", learning_rate, 0)
        if self.fused_update:
            self.weights = fused.weights_of(network)
            self.optimizer = Adam([array.reshape(-1) for array in self.weights], learning_rate)
        else:
            self.optimizer = torch.optim.Adam(network.parameters(), learning_rate)
        self.target = {name: value.clone() for name, value in network.state_dict().items()}

    def act(
        self,
        observations: np.ndarray,
        masks: np.ndarray,
        epsilon: float,
        rng: np.random.Generator,
    ) -> np.ndarray:
        """Choose actions ε-greedily.

        Args:
            observations: (batch, items, 3) float32.
            masks: (batch, items), bool or 0 and 1, where an item may be picked.
            epsilon: probability of a random allowed action.
            rng: draws who explores, and what.

        Returns:
            (batch,) int64.

        Raises:
            TypeError, ValueError: see ``unload.policies.check_batch``; ``epsilon`` is no
                number in [0, 1], or ``rng`` no generator.
        """
        observations, allowed = check_batch(observations, masks)
        checks.real("epsilon", epsilon, 0, 1)
        return self.choose(observations, allowed, epsilon, checks.generator("rng", rng))

    def choose(
        self,
        observations: np.ndarray,
        allowed: np.ndarray,
        epsilon: float,
        rng: np.random.Generator,
    ) -> np.ndarray:
        """``act`` without its checks, for what an environment shows: float arrays, bool masks."""
        explore = rng.random(len(observations)) < epsilon
        exploit = ~explore
        actions = np.empty(len(observations), np.int64)
        actions[explore] = any_allowed(allowed[explore], rng)
        if exploit.any():
            seen = observations[exploit].astype(np.float32, copy=False), allowed[exploit]
            if self.fused_update:
                actions[exploit] = fused.greedy_actions(self.weights, *seen)
            else:
                actions[exploit] = best_actions(self.network, *seen)
        return actions

    def update(self, batch: dict[str, np.ndarray], rows: np.ndarray | None = None) -> float:
        """One step of Adam.

        Args:
            batch: arrays as ``ReplayBuffer.sample`` returns them, or all that it holds.
            rows: (batch,) int64, which rows of the arrays to learn from; None for all. The
                fused update reads them where they are, which saves copying them.

        Returns:
            The loss before the step.

        Raises:
            TypeError, ValueError: ``batch`` is no dict, or an array is missing.
            FloatingPointError: the loss is not finite; the weights are left as they were.
        """
        return self.start_update(batch, rows)()

    def start_update(
        self, batch: dict[str, np.ndarray], rows: np.ndarray | None = None
    ) -> Callable[[], float]:
        """Begin ``update``; the fused one goes on in other threads while this one acts.

        Returns:
            A function that completes the update, returns the loss and may raise as ``update``
            does. The weights stay as they are until it is called, and so must the arrays.

        Raises:
            TypeError, ValueError: as ``update`` does.
        """
        names = ("next_observations", "next_masks", "terminations") if self.gamma else ()
        names = ("observations", "actions", "rewards", *names)
        checks.entries("batch", batch, names)
        if rows is not None and (self.gamma or not self.fused_update):
            batch, rows = {name: batch[name].take(rows, axis=0) for name in names}, None
        if not self.fused_update:
            return partial(self._plain_update, batch)
        targets = self._targets(batch).numpy() if self.gamma else batch["rewards"]
        finish_gradients = fused.start(
            self.weights, batch["observations"], batch["actions"], targets, self.beta, rows
        )

        def finish() -> float:
            total = finish_gradients()
            self.optimizer.step(total[:-1])
            return float(total[-1])

        return finish

    def _plain_update(self, batch: dict[str, np.ndarray]) -> float:
        loss = self._loss_and_gradients(batch)
        self.optimizer.step()
        return loss

    def _loss_and_gradients(self, batch: dict[str, np.ndarray]) -> float:
        """The smooth-L1 loss, its gradients left in ``.grad``: plain PyTorch."""
        targets = self._targets(batch)
        observations = torch.from_numpy(batch["observations"])
        actions = torch.from_numpy(batch["actions"])
        self.optimizer.zero_grad()
        total = 0.0
        for start in range(0, len(targets), CHUNK):
            rows = slice(start, start + CHUNK)
            values = self.network(observations[rows])
            chosen = values.gather(1, actions[rows, None]).squeeze(1)
            loss = smooth_l1_loss(chosen, targets[rows], reduction="sum", beta=self.beta)
            (loss / len(targets)).backward()
            total += loss.item() / len(targets)
        if not np.isfinite(total):
            raise FloatingPointError(f"the loss is {total}; expected a finite number")
        return total

    @torch.no_grad()
    def _targets(self, batch: dict[str, np.ndarray]) -> torch.Tensor:
        """r + γ max over the allowed actions of the target network, (batch,) float32."""
        rewards = torch.from_numpy(batch["rewards"])
        if self.gamma == 0:
            return rewards
        following = torch.from_numpy(batch["next_observations"])
        values = torch.func.functional_call(self.network, self.target, (following,))
        best = values.masked_fill(torch.from_numpy(~batch["next_masks"]), -torch.inf).amax(dim=1)
        return rewards + self.gamma * best.masked_fill(torch.from_numpy(batch["terminations"]), 0)

    def update_target(self) -> None:
        """Copy the network's weights to the target network."""
        self.target = {name: value.clone() for name, value in self.network.state_dict().items()}

    def state(self) -> dict[str, np.ndarray]:
        """Weights, target weights and optimizer state as arrays, to go on from later."""
        arrays = {f"network.{k}": v.numpy().copy() for k, v in self.network.state_dict().items()}
        arrays |= {f"target.{k}": v.numpy().copy() for k, v in self.target.items()}
        if self.fused_update:
            optimizer = self.optimizer.state()
        else:
            optimizer = {
                f"{number}.{key}": value.numpy().copy()
                for number, moments in self.optimizer.state_dict()["state"].items()
                for key, value in moments.items()
            }
        return arrays | {f"adam.{name}": array for name, array in optimizer.items()}

    def load_state(self, arrays: dict[str, np.ndarray]) -> None:
        """Go on from what ``state`` returned."""
        groups: dict[str, dict[str, np.ndarray]] = {"network": {}, "target": {}, "adam": {}}
        for name, array in arrays.items():
            group, _, rest = name.partition(".")
            groups[group][rest] = array
        self.network.load_state_dict(_tensors(groups["network"]))
        self.target = _tensors(groups["target"])
        if self.fused_update:
            self.optimizer.load_state(groups["adam"])
            return
        moments: dict[int, dict[str, torch.Tensor]] = {}
        for name, tensor in _tensors(groups["adam"]).items():
            number, _, key = name.partition(".")
            moments.setdefault(int(number), {})[key] = tensor
        optimizer = self.optimizer.state_dict()
        self.optimizer.load_state_dict({**optimizer, "state": moments})


def _tensors(arrays: dict[str, np.ndarray]) -> dict[str, torch.Tensor]:
    return {name: torch.from_numpy(np.array(array)) for name, array in arrays.items()}
