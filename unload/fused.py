"""The update and the greedy choice of a ``PEQNetwork`` in one pass each, on the CPU.

PyTorch stores every feature of every item of the batch several times over; the memory
traffic takes nearly all of an update's time. Two facts of this network make that needless:

- ReLU is monotone, so a feature's minimum and maximum over the items are those of the
  value before the ReLU, and their gradients need only the items where they stand.
- The mean of a feature needs only the sum of the inputs of the items where it is active:
  mean ReLU(w·x + b) = (w·Σx + b·count) / items, and its gradient is that sum itself.

So each item is read once, and only sums over items are kept. ``DQN`` uses these functions
where ``applies`` says so; they give PyTorch's gradients up to rounding.
"""

import numba
import numpy as np
import torch

from unload.network import PEQNetwork

CHUNK = 32  # samples whose gradients are summed in single precision

WIDTH = 16  # features handled together
SUMS = 8  # numbers kept of each feature, see _reduce_items
FLAGS = {"contract", "nsz"}  # fused multiply-add; no reordering, so that bits are stable
ZERO, ONE = np.float32(0), np.float32(1)


def applies(network: torch.nn.Module) -> bool:
    """The rule: a ``PEQNetwork`` itself (no subclass), in float32 on the CPU."""
    return type(network) is PEQNetwork and all(
        p.device.type == "cpu" and p.dtype == torch.float32 for p in network.parameters()
    )


def loss_and_gradients(
    network: PEQNetwork,
    observations: np.ndarray,
    actions: np.ndarray,
    targets: np.ndarray,
    beta: float = 1.0,
) -> float:
    """Mean smooth-L1 loss of the chosen actions' values, its gradients left in ``.grad``.

    Args:
        network: whose parameters' ``.grad`` are set.
        observations: (batch, items, 3) float32.
        actions: (batch,) int64, in 0 … items-1.
        targets: (batch,) float32.
        beta: of the smooth-L1 loss, > 0.

    Returns:
        The loss.

    Raises:
        ValueError: an array's shape or dtype is another, or an action is out of range.
        FloatingPointError: the loss or a gradient is not finite; ``.grad`` stays as it was.
    """
    size, items = _check(observations)
    for name, array, dtype in (("actions", actions, np.int64), ("targets", targets, np.float32)):
        if array.shape != (size,) or array.dtype != dtype:
            raise ValueError(
                f"{name} has shape {array.shape} and dtype {array.dtype}; "
                f"expected ({size},) {np.dtype(dtype)}"
            )
    if actions.min() < 0 or actions.max() >= items:
        raise ValueError(
            f"actions holds {actions.min()} to {actions.max()}; expected 0 to {items - 1}"
        )
    weights = _weights(network)
    partial = np.zeros((-(-len(actions) // CHUNK), 8 * network.n_features + 2), np.float32)
    _chunks(observations, actions, targets, np.float32(beta), *weights, partial)
    total = partial.sum(axis=0, dtype=np.float64) / len(actions)
    if not np.isfinite(total).all():
        raise FloatingPointError(
            f"the loss is {total[-1]} and its gradients are not all finite; "
            "expected finite observations, targets and weights"
        )
    n = network.n_features
    gradients = torch.from_numpy(total[:-1].astype(np.float32))
    network.extractor.weight.grad = gradients[: 3 * n].view(3, n).T.contiguous()
    network.extractor.bias.grad = gradients[3 * n : 4 * n].clone()
    network.scorer.weight.grad = gradients[4 * n : 8 * n].view(1, 4 * n).clone()
    network.scorer.bias.grad = gradients[8 * n :].clone()
    return float(total[-1])


def greedy_actions(
    network: PEQNetwork, observations: np.ndarray, allowed: np.ndarray
) -> np.ndarray:
    """The allowed action of the highest value.

    The global features add the same to every item's score and tanh keeps the order, so
    the item's own features decide.

    Args:
        network: the network.
        observations: (batch, items, 3) float32.
        allowed: (batch, items) bool, at least one per row.

    Returns:
        (batch,) int64.

    Raises:
        ValueError: an array's shape or dtype is another.
        FloatingPointError: a row has no allowed action of a finite value.
    """
    size, items = _check(observations)
    if allowed.shape != (size, items) or allowed.dtype != bool:
        raise ValueError(
            f"allowed has shape {allowed.shape} and dtype {allowed.dtype}; "
            f"expected ({size}, {items}) bool"
        )
    weight, bias, score, _ = _weights(network)
    actions = np.full(size, -1)
    _best(observations, allowed, weight, bias, score[0], actions)
    if (actions < 0).any():
        raise FloatingPointError(
            f"row {int(np.argmin(actions))} has no allowed action of a finite value; "
            "expected finite observations and weights"
        )
    return actions


def _check(observations: np.ndarray) -> tuple[int, int]:
    """Batch size and number of items of (batch, items, 3) float32 observations."""
    if (
        observations.ndim != 3
        or 0 in observations.shape
        or observations.shape[2] != 3
        or observations.dtype != np.float32
    ):
        raise ValueError(
            f"observations has shape {observations.shape} and dtype {observations.dtype}; "
            "expected (batch, items, 3) float32, not empty"
        )
    return observations.shape[:2]


def _weights(network: PEQNetwork) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.float32]:
    """Extractor weights (3, n) and biases (n,), scorer weights (4, n) and bias."""
    with torch.no_grad():
        return (
            np.ascontiguousarray(network.extractor.weight.numpy().T),
            network.extractor.bias.numpy(),
            network.scorer.weight.numpy().reshape(4, -1),
            np.float32(network.scorer.bias.item()),
        )


@numba.njit(fastmath=FLAGS, cache=True)
def _chunks(observations, actions, targets, beta, weight, bias, score, score_bias, partial):
    """Sum the gradients of each chunk of samples into its row of ``partial``."""
    blocks = _blocks(weight, bias)
    for chunk in range(len(partial)):
        sums = np.empty((len(blocks), SUMS * WIDTH), np.float32)
        for sample in range(chunk * CHUNK, min((chunk + 1) * CHUNK, len(actions))):
            for block in range(len(blocks)):
                _reduce_items(observations[sample], blocks[block], sums[block])
            _add_sample(
                observations[sample], actions[sample], targets[sample], beta,
                weight, bias, score, score_bias, sums, partial[chunk],
            )  # fmt: skip


@numba.njit(cache=True)
def _blocks(weight, bias):
    """The extractor's weights in blocks of ``WIDTH`` features, (blocks, 4 * WIDTH)."""
    blocks = np.zeros((-(-len(bias) // WIDTH), 4 * WIDTH), np.float32)
    for f in range(len(bias)):
        block, place = f // WIDTH, f % WIDTH
        for axis in range(3):
            blocks[block, axis * WIDTH + place] = weight[axis, f]
        blocks[block, 3 * WIDTH + place] = bias[f]
    return blocks


@numba.njit(fastmath=FLAGS, cache=True)
def _reduce_items(x, block, sums):
    """What is needed of all items, for ``WIDTH`` features at once.

    ``sums`` holds, ``WIDTH`` numbers each: the lowest value before the ReLU and its item,
    the highest and its item, the number of active items and the sums of their x, y, z.
    Constant widths let the compiler use vector instructions.
    """
    for f in range(WIDTH):
        sums[f], sums[2 * WIDTH + f] = np.inf, -np.inf
        for row in (1, 3, 4, 5, 6, 7):
            sums[row * WIDTH + f] = 0
    last = len(x) - 1
    for i in range(0, len(x), 4):
        # Four items at a time; the last one is repeated, with weight 0, to fill up.
        i1, i2, i3 = min(i + 1, last), min(i + 2, last), min(i + 3, last)
        w1, w2, w3 = np.float32(i + 1 <= last), np.float32(i + 2 <= last), np.float32(i + 3 <= last)
        x0, y0, z0, n0 = x[i, 0], x[i, 1], x[i, 2], np.float32(i)
        x1, y1, z1, n1 = x[i1, 0], x[i1, 1], x[i1, 2], np.float32(i1)
        x2, y2, z2, n2 = x[i2, 0], x[i2, 1], x[i2, 2], np.float32(i2)
        x3, y3, z3, n3 = x[i3, 0], x[i3, 1], x[i3, 2], np.float32(i3)
        for f in range(WIDTH):
            wx, wy, wz = block[f], block[WIDTH + f], block[2 * WIDTH + f]
            bias = block[3 * WIDTH + f]
            v0, v1 = wx * x0 + wy * y0 + wz * z0 + bias, wx * x1 + wy * y1 + wz * z1 + bias
            v2, v3 = wx * x2 + wy * y2 + wz * z2 + bias, wx * x3 + wy * y3 + wz * z3 + bias
            low, low_item = _lower(*_lower(v0, n0, v1, n1), *_lower(v2, n2, v3, n3))
            high, high_item = _lower(*_lower(-v0, n0, -v1, n1), *_lower(-v2, n2, -v3, n3))
            sums[f], sums[WIDTH + f] = _lower(sums[f], sums[WIDTH + f], low, low_item)
            high, high_item = _lower(-sums[2 * WIDTH + f], sums[3 * WIDTH + f], high, high_item)
            sums[2 * WIDTH + f], sums[3 * WIDTH + f] = -high, high_item
            a0, a1 = ONE if v0 > 0 else ZERO, w1 if v1 > 0 else ZERO
            a2, a3 = w2 if v2 > 0 else ZERO, w3 if v3 > 0 else ZERO
            sums[4 * WIDTH + f] += (a0 + a1) + (a2 + a3)
            sums[5 * WIDTH + f] += (a0 * x0 + a1 * x1) + (a2 * x2 + a3 * x3)
            sums[6 * WIDTH + f] += (a0 * y0 + a1 * y1) + (a2 * y2 + a3 * y3)
            sums[7 * WIDTH + f] += (a0 * z0 + a1 * z1) + (a2 * z2 + a3 * z3)


@numba.njit(fastmath=FLAGS, cache=True)
def _lower(value, item, other, other_item):
    """The lower of two values, and the item where it stands; the first if they are equal."""
    return (value, item) if value <= other else (other, other_item)


@numba.njit(fastmath=FLAGS, cache=True)
def _add_sample(x, action, target, beta, weight, bias, score, score_bias, sums, out):
    """Forward and backward through what one sample's items were reduced to."""
    n, share = len(bias), ONE / np.float32(len(x))
    features = np.empty((4, n), np.float32)  # own, minimum, maximum, mean
    logit = score_bias
    for f in range(n):
        place, row = f % WIDTH, sums[f // WIDTH]
        own, mean = bias[f], bias[f] * row[4 * WIDTH + place]
        for axis in range(3):
            own += weight[axis, f] * x[action, axis]
            mean += weight[axis, f] * row[(5 + axis) * WIDTH + place]
        features[0, f] = max(own, ZERO)
        features[1, f] = max(row[place], ZERO)
        features[2, f] = max(row[2 * WIDTH + place], ZERO)
        features[3, f] = mean * share
        for kind in range(4):
            logit += score[kind, f] * features[kind, f]
    value = np.tanh(logit)
    error = value - target
    if abs(error) < beta:
        loss, slope = error * error / (2 * beta), error / beta
    else:
        loss, slope = abs(error) - beta / 2, np.sign(error)
    slope *= ONE - value * value
    for f in range(n):
        place, row = f % WIDTH, sums[f // WIDTH]
        low_item, high_item = int(row[WIDTH + place]), int(row[3 * WIDTH + place])
        to_own = slope * score[0, f] if features[0, f] > 0 else ZERO
        to_low = slope * score[1, f] if features[1, f] > 0 else ZERO
        to_high = slope * score[2, f] if features[2, f] > 0 else ZERO
        to_mean = slope * score[3, f] * share
        for axis in range(3):
            out[axis * n + f] += (
                to_own * x[action, axis]
                + to_low * x[low_item, axis]
                + to_high * x[high_item, axis]
                + to_mean * row[(5 + axis) * WIDTH + place]
            )
        out[3 * n + f] += to_own + to_low + to_high + to_mean * row[4 * WIDTH + place]
        for kind in range(4):
            out[(4 + kind) * n + f] += slope * features[kind, f]
    out[8 * n] += slope
    out[8 * n + 1] += loss


@numba.njit(fastmath={"contract", "nsz", "reassoc"}, cache=True)
def _best(observations, allowed, weight, bias, score, actions):
    for sample in range(len(actions)):
        best = -np.inf
        for i in range(observations.shape[1]):
            if allowed[sample, i]:
                a, b, c = observations[sample, i]
                logit = np.float32(0)
                for f in range(len(bias)):
                    value = weight[0, f] * a + weight[1, f] * b + weight[2, f] * c + bias[f]
                    logit += score[f] * max(value, np.float32(0))
                if logit > best:
                    best, actions[sample] = logit, i
