"""The compiled loops of ``fused``.

Features are handled in blocks of ``_BLOCK``, whose numbers lie in one flat array; samples in
chunks of ``CHUNK``, which several threads share.
"""

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from unload.support.compiled import compiled

CHUNK = 32  # samples whose gradients are summed in single precision
_BLOCK = 64  # features handled together: loops of constant length become vector instructions
_LANES = 16  # features in the longest vector: few enough to keep their sums in registers

# The ReLU makes all negative values 0, so it does not matter which of several negative items counts
# as the lowest. So items are compared by keys: the bits of a value, read as an integer, whose
# lowest bits are replaced by the item's number. In the order of keys the negative values come
# first, in reverse, then the positive ones: -0.5, -2, 1, 3. If any value is negative, the lowest
# key is that of the negative value nearest to 0, here -0.5, which becomes 0 like all others. A
# block stores a key as the float32 with the same bits: read as a number it is the value, but for
# its last digits.
#
# A block holds all that is known of _BLOCK features: rows of _BLOCK numbers, one feature a column.
#
#     rows    name              what, for each feature
#      0- 3   _WX … _BIAS       the extractor's weights of x, y and z, and its bias
#      4- 5   _LOW, _LOW2       the lowest key, and the lowest but one
#      6- 7   _HIGH, _HIGH2     the highest key, and the highest but one
#      8-23   _MEAN … _HIGHEST  inputs x, y, z and 1: their mean, the chosen item's, those of the
#                               lowest and of the highest item; groups of four rows each
#     24      _SLACK            closer than this to 0 or another, a value's order is unsure
#     25-32   _SCORE, _FEATURE  the scorer's weights, and the features: of the chosen item, the
#                               minimum, the maximum and the mean; four rows each
#     33      _PART             what they add to the value before tanh
#     34-41   _GRADIENT, …      of the extractor's weights and bias, and of _SCORE; four rows each
#
# A block lies in one flat array, and each name is where its first row starts there:
# ``block[_SLACK + f]`` belongs to feature f.
_WX, _WY, _WZ, _BIAS = 0, _BLOCK, 2 * _BLOCK, 3 * _BLOCK
_LOW, _LOW2, _HIGH, _HIGH2 = 4 * _BLOCK, 5 * _BLOCK, 6 * _BLOCK, 7 * _BLOCK
_MEAN, _OWN, _LOWEST, _HIGHEST = 8 * _BLOCK, 12 * _BLOCK, 16 * _BLOCK, 20 * _BLOCK
_SLACK, _SCORE, _FEATURE, _PART = 24 * _BLOCK, 25 * _BLOCK, 29 * _BLOCK, 33 * _BLOCK
_GRADIENT, _SCORE_GRADIENT, _SIZE = 34 * _BLOCK, 38 * _BLOCK, 42 * _BLOCK
# From the start of a group of inputs to the row of one of them: ``block[_HIGHEST + _Z + f]`` is z
# of the item that is highest in feature f.
_X, _Y, _Z, _CONSTANT = 0, _BLOCK, 2 * _BLOCK, 3 * _BLOCK

_FRACTION = 0x7FFFFF  # the bits of a float32 after its sign and exponent
_ABOVE_ALL, _BELOW_ALL = 0x7FFFFFFF, -0x80000000  # as keys: the largest and the smallest int32
_ZERO, _ONE = np.float32(0), np.float32(1)


@intrinsic
def _fma(typing_context, a, b, c):
    """a·b + c, rounded once.

    Left to itself, the compiler decides anew in each program where to round once and where
    twice. Said explicitly, the bits are the same wherever it runs.
    """

    def build(context, builder, signature, arguments):
        return builder.fma(*arguments)

    return a(a, a, a), build


@intrinsic
def _next_number(typing_context, counter):
    """Return ``counter``, (1,) int64, and raise it by one, in a single step for all threads."""

    def build(context, builder, signature, arguments):
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        return builder.atomic_rmw("add", data, context.get_constant(types.int64, 1), "monotonic")

    return types.int64(counter), build


@intrinsic
def _long_vectors(typing_context):
    """Compile the calling function for the longest vectors, and as if no two of its arrays overlap.

    By itself the compiler takes half of AVX-512's length, because the first processors that had
    it slowed down at its full length. And as long as an array that is written might overlap
    another one, the compiler neither keeps sums in registers nor reads ahead. No array that the
    calling function is given may do so.
    """

    def build(context, builder, signature, arguments):
        # A set; its own ``add`` takes the names of attributes only, not those with a value.
        set.add(builder.function.attributes, '"prefer-vector-width"="512"')
        for argument in context.call_conv.get_arguments(builder.function):
            if isinstance(argument.type, ir.PointerType):
                argument.add_attribute("noalias")
        return context.get_dummy_value()

    return types.void(), build


@compiled(nogil=True)
def add_chunks(
    counter, rows, observations, actions, targets, beta, weight, bias, score, score_bias, chunk_sums
):
    """Sum the gradients and losses of each chunk into its row of ``chunk_sums``.

    Several threads may call this with the same ``counter``, and share the chunks.
    """
    n, items = len(bias), observations.shape[1]
    samples = observations.reshape(len(observations), 3 * items)  # a sample's inputs in each row

    bits = 0  # of an item's number
    while items > 1 << bits:
        bits += 1
    mask = np.int32((1 << bits) - 1)
    # The relative error of a key: three roundings of the value, and the bits that it lacks.
    precision = np.float32(2.0**-21 + 2.0 ** (bits - 23))

    # Each thread takes the next chunk until none is left.
    blocks = _blocks(weight, bias, score)
    chunk = _next_number(counter)
    while chunk < len(chunk_sums):
        chosen = rows[chunk * CHUNK : (chunk + 1) * CHUNK]
        picked, wanted = actions[chosen], targets[chosen]  # asks the memory for all at once
        largest = _largest(samples, chosen)
        for b in range(len(blocks)):
            _start_chunk(largest, precision, blocks[b])

        # Forward and backward for one sample at a time: nothing of it is kept for later.
        sum_slopes, sum_losses = 0.0, 0.0 * largest + 0.0 * score_bias[0]  # NaN if not finite
        for number, row in enumerate(chosen):
            x = samples[row]
            logit = np.float64(score_bias[0])  # double: 1 - tanh² loses its digits near 1
            for b in range(len(blocks)):
                _reduce_items(x, items, mask, blocks[b])
                _find_extremes(x, items, mask, blocks[b])
                logit += _forward(x, picked[number], items, blocks[b])

            # Smooth L1 of the error, and its slope by the value before tanh.
            value = np.tanh(logit)
            error = value - wanted[number]
            if abs(error) < beta:
                loss, slope = error * error / (2 * beta), error / beta
            else:
                loss, slope = abs(error) - beta / 2, np.sign(error)
            slope *= 1 - value * value
            sum_slopes += slope
            sum_losses += loss
            for b in range(len(blocks)):
                _backward(np.float32(slope), blocks[b])

        # From blocks to the order of the weights.
        for f in range(n):
            block, place = blocks[f // _BLOCK], f % _BLOCK
            for axis in range(3):
                chunk_sums[chunk, 3 * f + axis] = block[_GRADIENT + axis * _BLOCK + place]
            chunk_sums[chunk, 3 * n + f] = block[_GRADIENT + _CONSTANT + place]
            for kind in range(4):
                kind_place = _SCORE_GRADIENT + kind * _BLOCK + place
                chunk_sums[chunk, (4 + kind) * n + f] = block[kind_place]
        chunk_sums[chunk, 8 * n], chunk_sums[chunk, 8 * n + 1] = sum_slopes, sum_losses
        chunk = _next_number(counter)


@compiled
def _blocks(weight, bias, score):
    """The weights in blocks of ``_BLOCK`` features.

    Where there are no more features, a bias of -1 keeps the ReLU closed.
    """
    count = -(-len(bias) // _BLOCK)
    memory = np.zeros(count * _SIZE + 16, np.float32)
    start = (-memory.ctypes.data // 4) % 16  # of a cache line, which a vector fills
    blocks = memory[start : start + count * _SIZE].reshape(count, _SIZE)
    blocks[:, _BIAS : _BIAS + _BLOCK] = -1
    for f in range(len(bias)):
        block, place = blocks[f // _BLOCK], f % _BLOCK
        for axis in range(3):
            block[_WX + axis * _BLOCK + place] = weight[f, axis]
        block[_BIAS + place] = bias[f]
        for kind in range(4):
            block[_SCORE + kind * _BLOCK + place] = score[kind, f]
    return blocks


@compiled
def _largest(samples, rows):
    """The largest magnitude; not finite if one of the inputs is not.

    Read as integers, the bits of positive numbers are in the order of the numbers; those of
    infinity and NaN come last.
    """
    largest = np.int32(0)
    for row in rows:
        for i in range(samples.shape[1]):
            magnitude = np.int32(_bits(samples[row, i]) & 0x7FFFFFFF)
            largest = magnitude if magnitude > largest else largest
    return _number(largest)


@compiled
def _start_chunk(largest, precision, block):
    """Set the gradients to zero, and bound the rounding error of each feature's values."""
    block[_GRADIENT:] = 0
    for f in range(_BLOCK):
        scale = abs(block[_WX + f]) + abs(block[_WY + f]) + abs(block[_WZ + f])
        scale = scale * largest + abs(block[_BIAS + f])  # no value is larger
        block[_SLACK + f] = scale * precision + np.float32(1e-30)


@compiled
def _reduce_items(inputs, items, mask, block):
    """Read all items: sums of the active ones, the two lowest and the two highest keys.

    Most of the time is spent here. There are no branches, so that ``_LANES`` features go side by
    side.
    """
    _long_vectors()
    # Every key is below the first lowest and above the first highest.
    for f in range(_BLOCK):
        block[_LOW + f] = block[_LOW2 + f] = _number(_ABOVE_ALL)
        block[_HIGH + f] = block[_HIGH2 + f] = _number(_BELOW_ALL)
        for axis in range(4):
            block[_MEAN + axis * _BLOCK + f] = _ZERO
    for first in range(0, _BLOCK, _LANES):
        for i in range(items):
            x, y, z = inputs[3 * i], inputs[3 * i + 1], inputs[3 * i + 2]
            for f in range(first, first + _LANES):
                value = _value(
                    block[_WX + f], block[_WY + f], block[_WZ + f], block[_BIAS + f], x, y, z
                )
                active = _active(value)
                block[_MEAN + _X + f] = _fma(active, x, block[_MEAN + _X + f])
                block[_MEAN + _Y + f] = _fma(active, y, block[_MEAN + _Y + f])
                block[_MEAN + _Z + f] = _fma(active, z, block[_MEAN + _Z + f])
                block[_MEAN + _CONSTANT + f] += active

                # The runner-up is the key, or what it has beaten, or the one so far.
                key = _key(value, np.int32(i), mask)
                low, high = _bits(block[_LOW + f]), _bits(block[_HIGH + f])
                low2 = min(_bits(block[_LOW2 + f]), max(low, key))
                high2 = max(_bits(block[_HIGH2 + f]), min(high, key))
                block[_LOW + f], block[_LOW2 + f] = _number(min(low, key)), _number(low2)
                block[_HIGH + f], block[_HIGH2 + f] = _number(max(high, key)), _number(high2)


@compiled(forceinline=True)
def _bits(number):
    """The bits of a float32 as an int32."""
    return np.float32(number).view(np.int32)


@compiled(forceinline=True)
def _number(bits):
    """The float32 that has these bits."""
    return np.int32(bits).view(np.float32)


@compiled(forceinline=True)
def _value(a, b, c, d, x, y, z):
    """A feature before the ReLU."""
    return _fma(a, x, _fma(b, y, _fma(c, z, d)))


@compiled(forceinline=True)
def _active(value):
    return _ONE if value > _ZERO else _ZERO


@compiled(forceinline=True)
def _key(value, item, mask):
    """The value's bits, the lowest of them replaced by the item's number: an int32."""
    return np.int32(np.int32(_bits(value) & ~mask) | item)


@compiled
def _find_extremes(x, items, mask, block):
    """The inputs of the lowest and of the highest item for the block's features."""
    _long_vectors()
    unsure = 0
    for f in range(_BLOCK):
        low, high = block[_LOW + f], block[_HIGH + f]
        _set_inputs(_inputs(x, low, mask), low > _ZERO, _LOWEST + f, block)
        _set_inputs(_inputs(x, high, mask), high > _ZERO, _HIGHEST + f, block)
        unsure += not (_lowest_is_sure(f, block) & _highest_is_sure(f, block))
    if unsure:  # rare, so that the loop above need not branch
        for f in range(_BLOCK):
            if not _lowest_is_sure(f, block):
                _decide(x, items, -1.0, f, _LOWEST + f, block)
            if not _highest_is_sure(f, block):
                _decide(x, items, 1.0, f, _HIGHEST + f, block)


@compiled(forceinline=True)
def _inputs(x, key, mask):
    """The inputs of the item whose number is in the key."""
    # Unsigned: so it is not counted from the end. ``& _FRACTION`` changes nothing, but tells the
    # compiler that the number is small: then one instruction fetches more.
    place = 3 * np.uint64(_bits(key) & mask & _FRACTION)
    return x[place], x[place + np.uint64(1)], x[place + np.uint64(2)]


@compiled(forceinline=True)
def _lowest_is_sure(f, block):
    """Whether the item of the lowest key is the lowest after the ReLU for certain.

    So it is if its value is clearly below 0, or clearly above 0 and clearly below all others.
    """
    low, low2, slack = block[_LOW + f], block[_LOW2 + f], block[_SLACK + f]
    return (low < -slack) | ((low > slack) & (low2 - low > slack))


@compiled(forceinline=True)
def _highest_is_sure(f, block):
    """Whether the item of the highest key is the highest after the ReLU for certain.

    So it is if its value is clearly above 0 and clearly above all others. Where all are negative,
    any item will do, if the one of the lowest key, which is nearest to 0, is clearly below 0.
    """
    low, high, slack = block[_LOW + f], block[_HIGH + f], block[_SLACK + f]
    negative = (high < _ZERO) & (low < -slack)
    return negative | ((high > slack) & (high - block[_HIGH2 + f] > slack))


@compiled(forceinline=True)
def _set_inputs(inputs, active, place, block):
    """Set four inputs; zeros if the ReLU is closed."""
    block[place + _X] = inputs[0] if active else _ZERO
    block[place + _Y] = inputs[1] if active else _ZERO
    block[place + _Z] = inputs[2] if active else _ZERO
    block[place + _CONSTANT] = _ONE if active else _ZERO


@compiled
def _decide(x, items, sign, f, place, block):
    """Set the inputs of one feature's highest (sign 1) or lowest (-1) item by double precision.

    The mean of those that tie.
    """
    a, b, c, d = block[_WX + f], block[_WY + f], block[_WZ + f], block[_BIAS + f]
    best, count, px, py, pz = -np.inf, 1, 0.0, 0.0, 0.0
    for i in range(items):
        value = sign * (np.float64(a) * x[3 * i] + np.float64(b) * x[3 * i + 1])
        value += sign * (np.float64(c) * x[3 * i + 2] + d)
        if value > best:
            best, count, px, py, pz = value, 1, x[3 * i], x[3 * i + 1], x[3 * i + 2]
        elif value == best:
            count, px, py, pz = count + 1, px + x[3 * i], py + x[3 * i + 1], pz + x[3 * i + 2]
    mean = np.float32(px / count), np.float32(py / count), np.float32(pz / count)
    _set_inputs(mean, sign * best > 0, place, block)


@compiled
def _forward(inputs, item, items, block):
    """Set the inputs of the chosen item, and all features; their part of the value before tanh."""
    _long_vectors()
    x, y, z = inputs[3 * item], inputs[3 * item + 1], inputs[3 * item + 2]
    share = _ONE / np.float32(items)
    # Inputs of the chosen item; and of the mean, whose sums become means.
    for f in range(_BLOCK):
        own = np.float64(block[_WX + f]) * x + np.float64(block[_WY + f]) * y
        own += np.float64(block[_WZ + f]) * z + block[_BIAS + f]
        _set_inputs((x, y, z), own > 0, _OWN + f, block)
        block[_MEAN + _X + f] *= share
        block[_MEAN + _Y + f] *= share
        block[_MEAN + _Z + f] *= share
        block[_MEAN + _CONSTANT + f] *= share

    # All four features, and what each adds to the value.
    for f in range(_BLOCK):
        part = _feature(_OWN, 0, f, block) + _feature(_LOWEST, 1, f, block)
        block[_PART + f] = part + (_feature(_HIGHEST, 2, f, block) + _feature(_MEAN, 3, f, block))
    # Their sum, in an order that needs few steps one after the other: halves onto halves.
    half = _BLOCK // 2
    while half:
        for f in range(half):
            block[_PART + f] += block[_PART + half + f]
        half //= 2
    return block[_PART]


@compiled(forceinline=True)
def _feature(inputs, kind, f, block):
    """Set one feature, weights · inputs; its part of the value before tanh."""
    place = inputs + f
    feature = block[_BIAS + f] * block[place + _CONSTANT]
    feature = _fma(block[_WZ + f], block[place + _Z], feature)
    feature = _fma(block[_WY + f], block[place + _Y], feature)
    feature = _fma(block[_WX + f], block[place + _X], feature)
    block[_FEATURE + kind * _BLOCK + f] = feature
    return block[_SCORE + kind * _BLOCK + f] * feature


@compiled
def _backward(slope, block):
    """Add one sample's gradients; ``slope`` is the loss's by the value before tanh."""
    _long_vectors()
    for f in range(_BLOCK):
        own, low = slope * block[_SCORE + f], slope * block[_SCORE + _BLOCK + f]
        high, mean = slope * block[_SCORE + 2 * _BLOCK + f], slope * block[_SCORE + 3 * _BLOCK + f]
        for axis in range(4):
            row = axis * _BLOCK + f
            gradient = _fma(own, block[_OWN + row], block[_GRADIENT + row])
            gradient = _fma(low, block[_LOWEST + row], gradient)
            gradient = _fma(high, block[_HIGHEST + row], gradient)
            block[_GRADIENT + row] = _fma(mean, block[_MEAN + row], gradient)
        for kind in range(4):
            row = _SCORE_GRADIENT + kind * _BLOCK + f
            block[row] = _fma(slope, block[_FEATURE + kind * _BLOCK + f], block[row])


@compiled
def best_items(observations, allowed, weight, bias, score, actions):
    """Write the item of the highest own score, the first one if several have it, to ``actions``.

    Where an allowed item's score is not finite, the action becomes -1.
    """
    x = np.empty((3, observations.shape[1]), np.float32)
    scores = np.empty(observations.shape[1], np.float32)
    for sample in range(len(actions)):
        for i in range(len(scores)):
            for axis in range(3):
                x[axis, i] = observations[sample, i, axis]

        # Feature by feature, so that the items of each go side by side in vectors.
        scores[:] = 0
        for f in range(len(bias)):
            a, b, c, d, s = weight[f, 0], weight[f, 1], weight[f, 2], bias[f], score[f]
            for i in range(len(scores)):
                value = _value(a, b, c, d, x[0, i], x[1, i], x[2, i])
                scores[i] = _fma(s, _ZERO if value < _ZERO else value, scores[i])

        best = -np.inf
        for i in range(len(scores)):
            if not allowed[sample, i]:
                continue
            if not np.isfinite(scores[i]):
                actions[sample] = -1
                break
            if scores[i] > best:
                best, actions[sample] = scores[i], i
