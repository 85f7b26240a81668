"""The update and the greedy choice of a ``PEQNetwork`` in one pass each, on the CPU.

PyTorch stores every feature of every item of the batch several times over; the memory
traffic takes nearly all of an update's time. Two facts of this network make that needless:

- ReLU is monotone, so the lowest and the highest value of a feature stand where they stand
  before the ReLU. Of all items, their gradients need only these two.
- The mean needs only sums over the items where the feature is active (positive):
  mean ReLU(w·x + b) = (w·Σx + b·count) / items.

So every item is read once and forgotten. What is left of a sample are four inputs (x, y, z, 1)
per feature: of the chosen item, of the lowest, of the highest and the mean of the active ones,
0 where the ReLU closes. All the rest is linear in them: the four features are weights · input,
and each gradient is the input times a factor. ``DQN`` uses these functions where ``applies``
says so; they give the gradients of double precision to about six digits.

Two items may be so close that single precision cannot tell which is higher. Such near ties are
noticed, by keeping the runner-up, and decided in double precision. Items that tie even there
share the gradient evenly, as in PyTorch.
"""

import threading

import numba
import numpy as np
import torch

from unload.network import PEQNetwork

CHUNK = 32  # samples whose gradients are summed in single precision
CHUNKS_PER_THREAD = 8  # at least; starting a thread takes as long as one or two chunks
WIDTH = 64  # features handled together: loops of constant length become vector instructions

# Where in a flat array (ROWS * WIDTH) the numbers kept of ``WIDTH`` features start.
ROWS = 41
STARTS = range(0, ROWS * WIDTH, WIDTH)
WX, WY, WZ, BIAS = STARTS[:4]  # extractor weights
SCORE, SCORE1, SCORE2, SCORE3 = STARTS[4:8]  # scorer weights of the own, minimum, maximum and mean feature
SLACK = STARTS[8]  # values closer than this may be in the wrong order
LOW, LOW2, HIGH, HIGH2 = STARTS[9:13]  # keys of the lowest and highest two, see _key
OWN, LOWEST, HIGHEST, MEAN = STARTS[13:29:4]  # inputs x, y, z, 1
FEATURE = STARTS[29]  # 4 rows: the own, minimum, maximum and mean feature
GRADIENT = STARTS[33]  # 8 rows: of the extractor weights and of the scorer weights

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
    partial = np.full((-(-size // CHUNK), 8 * network.n_features + 2), np.nan, np.float32)
    _run(observations, actions, targets, np.float32(beta), *weights, partial)
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


def _run(*arguments) -> None:
    """``_chunks`` on as many threads as PyTorch would use; the sums are the same on any."""
    chunks = len(arguments[-1])
    threads = max(1, min(torch.get_num_threads(), chunks // CHUNKS_PER_THREAD))
    helpers = [
        threading.Thread(target=_chunks, args=(k, threads, *arguments)) for k in range(1, threads)
    ]
    for helper in helpers:
        helper.start()
    _chunks(0, threads, *arguments)
    for helper in helpers:
        helper.join()


@numba.njit(cache=True, nogil=True)
def _chunks(
    first, step, observations, actions, targets, beta, weight, bias, score, score_bias, partial
):
    """Sum the gradients and losses of every ``step``-th chunk into its row of ``partial``."""
    n, items = len(bias), observations.shape[1]
    blocks = np.zeros((-(-n // WIDTH), ROWS * WIDTH), np.float32)
    for f in range(n):
        block, place = blocks[f // WIDTH], f % WIDTH
        for axis in range(3):
            block[WX + axis * WIDTH + place] = weight[axis, f]
        block[BIAS + place] = bias[f]
        for kind in range(4):
            block[SCORE + kind * WIDTH + place] = score[kind, f]
    bits = 0  # that number the items
    while items > 1 << bits:
        bits += 1
    x = np.empty((-(-items // 4) * 4, 3), np.float32)  # one sample's items, a multiple of 4
    for chunk in range(first, len(partial), step):
        samples = range(chunk * CHUNK, min((chunk + 1) * CHUNK, len(actions)))
        largest = _largest(observations[samples.start : samples.stop])
        # Rounding, and the bits that _key takes, relative to the largest possible value.
        precision = np.float32(2.0 ** (bits - 23) + 2.0**-21)
        for block in blocks:
            block[GRADIENT:] = 0
            for f in range(WIDTH):
                size = abs(block[WX + f]) + abs(block[WY + f]) + abs(block[WZ + f])
                size = size * largest + abs(block[BIAS + f])
                block[SLACK + f] = size * precision + np.float32(1e-30)
        sum_slopes, sum_losses = ZERO, ZERO * largest
        for sample in samples:
            for i in range(len(x)):
                for axis in range(3):
                    x[i, axis] = observations[sample, min(i, items - 1), axis]
            logit = score_bias
            for b in range(len(blocks)):
                _reduce(x, items, blocks[b], np.int32((1 << bits) - 1))
                _find(x, items, min(WIDTH, n - b * WIDTH), (1 << bits) - 1, blocks[b])
                logit += _forward(x, actions[sample], items, blocks[b])
            value = np.tanh(logit)
            error = value - targets[sample]
            if abs(error) < beta:
                sum_losses += error * error / (2 * beta)
                slope = error / beta
            else:
                sum_losses += abs(error) - beta / 2
                slope = np.sign(error)
            slope *= ONE - value * value
            sum_slopes += slope
            for block in blocks:
                _backward(slope, block)
        for f in range(n):
            for row in range(8):
                partial[chunk, row * n + f] = blocks[f // WIDTH, GRADIENT + row * WIDTH + f % WIDTH]
        partial[chunk, 8 * n], partial[chunk, 8 * n + 1] = sum_slopes, sum_losses


@numba.njit(cache=True)
def _largest(observations):
    """The largest magnitude; not finite if one is not.

    The bits of positive numbers, read as integers, are ordered as the numbers are; those of
    infinity and NaN come last.
    """
    bits, largest = observations.reshape(-1).view(np.int32), np.int32(0)
    for i in range(len(bits)):
        magnitude = np.int32(bits[i] & 0x7FFFFFFF)
        largest = magnitude if magnitude > largest else largest
    return np.int32(largest).view(np.float32)


@numba.njit(fastmath=FLAGS, cache=True)
def _reduce(x, items, block, mask):
    """Read all items, four at a time: sums of the active ones, keys of the lowest and highest."""
    keys = block.view(np.int32)
    keys[LOW:HIGH] = 0x7FFFFFFF
    keys[HIGH:OWN] = -0x80000000
    block[MEAN:FEATURE] = 0
    for i in range(0, len(x), 4):
        x0, x1, x2, x3 = x[i, 0], x[i + 1, 0], x[i + 2, 0], x[i + 3, 0]
        y0, y1, y2, y3 = x[i, 1], x[i + 1, 1], x[i + 2, 1], x[i + 3, 1]
        z0, z1, z2, z3 = x[i, 2], x[i + 1, 2], x[i + 2, 2], x[i + 3, 2]
        i0, i1, i2, i3 = np.int32(i), np.int32(i + 1), np.int32(i + 2), np.int32(i + 3)
        for f in range(WIDTH):
            a, b, c, d = block[WX + f], block[WY + f], block[WZ + f], block[BIAS + f]
            v0, v1 = a * x0 + (b * y0 + (c * z0 + d)), a * x1 + (b * y1 + (c * z1 + d))
            v2, v3 = a * x2 + (b * y2 + (c * z2 + d)), a * x3 + (b * y3 + (c * z3 + d))
            block[MEAN + f] = _add_active(block[MEAN + f], v0, v1, v2, v3, x0, x1, x2, x3)
            block[MEAN + 1 * WIDTH + f] = _add_active(block[MEAN + 1 * WIDTH + f], v0, v1, v2, v3, y0, y1, y2, y3)
            block[MEAN + 2 * WIDTH + f] = _add_active(block[MEAN + 2 * WIDTH + f], v0, v1, v2, v3, z0, z1, z2, z3)
            block[MEAN + 3 * WIDTH + f] = _add_active(
                block[MEAN + 3 * WIDTH + f], v0, v1, v2, v3, ONE, ONE, ONE, ONE
            )
            k0, k1, k2, k3 = _key(v0, i0, mask), _key(v1, i1, mask), _key(v2, i2, mask), _key(v3, i3, mask)
            a0, a1 = _lower(k0, k1), _higher(k0, k1)
            a2, a3 = _lower(k2, k3), _higher(k2, k3)
            low, high = _lower(a0, a2), _higher(a1, a3)
            b0, b1 = _higher(a0, a2), _lower(a1, a3)
            low2, high2 = _lower(b0, b1), _higher(b0, b1)
            keys[LOW2 + f] = _lower(_lower(keys[LOW2 + f], low2), _higher(keys[LOW + f], low))
            keys[LOW + f] = _lower(keys[LOW + f], low)
            keys[HIGH2 + f] = _higher(_higher(keys[HIGH2 + f], high2), _lower(keys[HIGH + f], high))
            keys[HIGH + f] = _higher(keys[HIGH + f], high)
    for i in range(items, len(x)):  # the repeated items count nothing
        for f in range(WIDTH):
            a, b, c, d = block[WX + f], block[WY + f], block[WZ + f], block[BIAS + f]
            on = ONE if a * x[i, 0] + (b * x[i, 1] + (c * x[i, 2] + d)) > ZERO else ZERO
            block[MEAN + f] -= on * x[i, 0]
            block[MEAN + WIDTH + f] -= on * x[i, 1]
            block[MEAN + 2 * WIDTH + f] -= on * x[i, 2]
            block[MEAN + 3 * WIDTH + f] -= on


@numba.njit(fastmath=FLAGS, cache=True, forceinline=True)
def _add_active(total, v0, v1, v2, v3, x0, x1, x2, x3):
    total += x0 if v0 > ZERO else ZERO
    total += x1 if v1 > ZERO else ZERO
    total += x2 if v2 > ZERO else ZERO
    total += x3 if v3 > ZERO else ZERO
    return total


@numba.njit(cache=True, forceinline=True)
def _key(value, item, mask):
    return np.int32(np.int32(np.float32(value).view(np.int32) & ~mask) | item)


@numba.njit(cache=True, forceinline=True)
def _lower(p, q):
    return q if q < p else p


@numba.njit(cache=True, forceinline=True)
def _higher(p, q):
    return q if q > p else p


@numba.njit(cache=True)
def _find(x, items, n, mask, block):
    """The inputs of the lowest and the highest item; zeros where the ReLU closes."""
    keys = block.view(np.int32)
    for f in range(n):
        low, high, slack = block[LOW + f], block[HIGH + f], block[SLACK + f]
        i = keys[LOW + f] & mask
        on = ONE if low > 0 else ZERO
        block[LOWEST + f] = on * x[i, 0]
        block[LOWEST + 1 * WIDTH + f] = on * x[i, 1]
        block[LOWEST + 2 * WIDTH + f] = on * x[i, 2]
        block[LOWEST + 3 * WIDTH + f] = on
        i = keys[HIGH + f] & mask
        on = ONE if high > 0 else ZERO
        block[HIGHEST + f] = on * x[i, 0]
        block[HIGHEST + 1 * WIDTH + f] = on * x[i, 1]
        block[HIGHEST + 2 * WIDTH + f] = on * x[i, 2]
        block[HIGHEST + 3 * WIDTH + f] = on
        if not (low < -slack or (low > slack and block[LOW2 + f] - low > slack)):
            _decide(x, items, -1.0, f, LOWEST, block)
        if not ((high < 0 and low < -slack) or (high > slack and high - block[HIGH2 + f] > slack)):
            _decide(x, items, 1.0, f, HIGHEST, block)


@numba.njit(cache=True)
def _decide(x, items, sign, f, out, block):
    """The same for one feature in double precision; items that tie share evenly."""
    a, b = sign * block[WX + f], sign * block[WY + f]
    c, d = sign * block[WZ + f], sign * block[BIAS + f]
    best, count, px, py, pz = -np.inf, 0.0, 0.0, 0.0, 0.0
    for i in range(items):
        value = a * x[i, 0] + b * x[i, 1] + c * x[i, 2] + d
        if value > best:
            best, count, px, py, pz = value, 0.0, 0.0, 0.0, 0.0
        if value == best:
            count, px, py, pz = count + 1, px + x[i, 0], py + x[i, 1], pz + x[i, 2]
    on = sign * best > 0
    block[out + f] = px / max(count, 1.0) if on else 0
    block[out + WIDTH + f] = py / max(count, 1.0) if on else 0
    block[out + 2 * WIDTH + f] = pz / max(count, 1.0) if on else 0
    block[out + 3 * WIDTH + f] = 1 if on else 0


@numba.njit(fastmath=FLAGS | {"reassoc"}, cache=True)
def _forward(x, action, items, block):
    """The block's part of the value before tanh."""
    share = ONE / np.float32(items)
    x, y, z = x[action, 0], x[action, 1], x[action, 2]
    logit = ZERO
    for f in range(WIDTH):
        own = np.float64(block[WX + f]) * x + np.float64(block[WY + f]) * y
        own += np.float64(block[WZ + f]) * z + block[BIAS + f]
        on = ONE if own > 0 else ZERO
        block[OWN + f], block[OWN + 1 * WIDTH + f], block[OWN + 2 * WIDTH + f] = on * x, on * y, on * z
        block[OWN + 3 * WIDTH + f] = on
        block[MEAN + f] *= share
        block[MEAN + 1 * WIDTH + f] *= share
        block[MEAN + 2 * WIDTH + f] *= share
        block[MEAN + 3 * WIDTH + f] *= share
    for f in range(WIDTH):
        logit += (
            _feature(0, OWN, f, block)
            + _feature(1, LOWEST, f, block)
            + _feature(2, HIGHEST, f, block)
            + _feature(3, MEAN, f, block)
        )
    return logit


@numba.njit(fastmath=FLAGS, cache=True, forceinline=True)
def _feature(kind, inputs, f, block):
    feature = block[WX + f] * block[inputs + f] + block[WY + f] * block[inputs + 1 * WIDTH + f]
    feature += block[WZ + f] * block[inputs + 2 * WIDTH + f] + block[BIAS + f] * block[inputs + 3 * WIDTH + f]
    block[FEATURE + kind * WIDTH + f] = feature
    return block[SCORE + kind * WIDTH + f] * feature


@numba.njit(fastmath=FLAGS, cache=True)
def _backward(slope, block):
    for f in range(WIDTH):
        for row in range(4):
            block[GRADIENT + (4 + row) * WIDTH + f] += slope * block[FEATURE + row * WIDTH + f]
    for f in range(WIDTH):
        own, low = slope * block[SCORE + f], slope * block[SCORE + 1 * WIDTH + f]
        high, mean = slope * block[SCORE + 2 * WIDTH + f], slope * block[SCORE + 3 * WIDTH + f]
        for axis in range(4):
            block[GRADIENT + axis * WIDTH + f] += (
                own * block[OWN + axis * WIDTH + f]
                + low * block[LOWEST + axis * WIDTH + f]
                + high * block[HIGHEST + axis * WIDTH + f]
                + mean * block[MEAN + axis * WIDTH + f]
            )


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
