"""The update and the greedy choice of a ``PEQNetwork`` in one pass each, on the CPU.

PyTorch stores every feature of every item of the batch several times over; the memory
traffic takes nearly all of an update's time. Two facts of this network make that needless:

- ReLU is monotone, so a feature is lowest and highest at the same items before the ReLU and
  after it. Of all items, the gradients of its minimum and maximum need these two only.
- The mean needs only sums over the items where the feature is active, that is positive:
  mean ReLU(w·x + b) = (w·Σx + b·count) / items.

So each item is read once, and all that is kept are four inputs (x, y, z, 1) per feature: those
of the chosen item, of the lowest, of the highest, and the mean of the active ones; zeros where
the ReLU is closed. The rest is linear: a feature is weights · inputs, and the gradient of the
weights is the inputs times a factor. ``DQN`` uses these functions where ``applies`` says so.

Two items may be so close that single precision takes the wrong one for the higher. The
runner-up is kept to notice that, and double precision decides. Items that tie even there share
the gradient evenly, as in PyTorch.
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import NamedTuple, TypeGuard

import numpy as np
import torch

from unload.fast.kernel import CHUNK, add_chunks, best_items
from unload.network.peq import PEQNetwork

_CHUNKS_PER_THREAD = 8  # at least; below, waking a thread takes longer than it saves


class Weights(NamedTuple):
    """Views of the weights of a ``PEQNetwork``, float32: to write to them changes the network.

    Attributes:
        weight, bias: of the extractor, (n, 3) and (n,).
        score, score_bias: of the scorer, (4, n) and (1,).
    """

    weight: np.ndarray
    bias: np.ndarray
    score: np.ndarray
    score_bias: np.ndarray


def applies(network: torch.nn.Module) -> TypeGuard[PEQNetwork]:
    """Return whether the fused update applies: a ``PEQNetwork`` (no subclass), float32, CPU."""
    return type(network) is PEQNetwork and all(
        p.device.type == "cpu" and p.dtype == torch.float32 for p in _parameters(network)
    )


def weights_of(network: PEQNetwork) -> Weights:
    """The weights of a network for which ``applies`` holds."""
    weight, bias, score, score_bias = (p.detach().numpy() for p in _parameters(network))
    return Weights(weight, bias, score.reshape(4, -1), score_bias)


def start_gradients(
    weights: Weights,
    observations: np.ndarray,
    actions: np.ndarray,
    targets: np.ndarray,
    beta: float = 1.0,
    rows: np.ndarray | None = None,
) -> Callable[[], np.ndarray]:
    """Begin to compute the mean smooth-L1 loss of the chosen actions' values, and its gradients.

    Up to ``torch.get_num_threads()`` threads do it. The others begin at once; this one joins them
    when the returned function is called. The result does not depend on their number.

    Compiled code reads and writes wherever it is told to: the arrays must be as described, which
    ``DQN.update`` checks and a ``Training`` takes care of.

    Args:
        observations: (batch, items, 3) float32.
        actions: (batch,) int64, in 0 … items-1.
        targets: (batch,) float32.
        beta: of the smooth-L1 loss, >= 0.
        rows: int64, which rows of these arrays are the batch, so that they need not be copied
            out of a large memory; None for all.

    Returns:
        A function that does what is left to do and returns (8n + 2,) float64: the gradients of
        ``weights``, one array after the other, and the loss. Until then, weights and arrays must
        stay as they are. It raises FloatingPointError unless all are finite.
    """
    rows = np.arange(len(actions)) if rows is None else rows
    batch = [np.ascontiguousarray(array) for array in (rows, observations, actions, targets)]
    # One row per chunk, added up in order: the number of threads cannot change the sum.
    chunk_sums = np.empty((-(-rows.size // CHUNK), 8 * len(weights.bias) + 2), np.float32)
    work = (np.zeros(1, np.int64), *batch, np.float32(beta), *weights, chunk_sums)

    # The caller's own thread takes part when it calls finish, and the others begin now.
    threads = min(torch.get_num_threads(), len(chunk_sums) // _CHUNKS_PER_THREAD)
    others = [_helpers(os.getpid()).submit(add_chunks, *work) for _ in range(1, threads)]

    def finish() -> np.ndarray:
        add_chunks(*work)
        for other in others:
            other.result()

        total = chunk_sums.sum(axis=0, dtype=np.float64) / rows.size
        if not np.isfinite(total).all():
            raise FloatingPointError(
                f"the loss is {total[-1]} and its gradients are not all finite; "
                "expected finite observations, targets and weights"
            )
        return total

    return finish


@cache
def _helpers(process: int) -> ThreadPoolExecutor:
    """Threads that wait for work; a process that was forked needs its own."""
    return ThreadPoolExecutor()


def best_actions(weights: Weights, observations: np.ndarray, allowed: np.ndarray) -> np.ndarray:
    """The allowed action of the highest value.

    The global features add the same to every item's score and tanh keeps the order, so
    the item's own features decide.

    Args:
        observations: (batch, items, 3) float32.
        allowed: (batch, items) bool, at least one per row.

    Returns:
        (batch,) int64.

    Raises:
        FloatingPointError: an allowed action has a value that is not finite.
    """
    actions = np.full(len(observations), -1)
    best_items(observations, allowed, weights.weight, weights.bias, weights.score[0], actions)
    if (actions < 0).any():
        raise FloatingPointError(
            f"row {int(np.argmin(actions))} has an allowed action whose value is not finite; "
            "expected finite observations and weights"
        )
    return actions


def _parameters(network: PEQNetwork) -> tuple[torch.Tensor, ...]:
    """Parameters in the order of ``Weights``; ``network.parameters()`` takes ten times as long."""
    extractor, scorer = network.extractor, network.scorer
    return extractor.weight, extractor.bias, scorer.weight, scorer.bias
