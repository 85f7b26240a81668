"""Algorithm 1 compiled, for many observations: ranks by counting, kept while items change.

``unload.equalize`` sorts; here an item's rank is the number of smaller items, which needs
no sorting, and when one item leaves and another comes, no recounting either. Arrays are
(axes, items), so that the items of one axis lie side by side; ``rank``, ``replace`` and ``remove``
take those of one axis. Of equal items the first
has the smaller rank, as in a stable sort. Where fewer than 128 items are left, they are the
first ones of the arrays.
"""

import numpy as np

from unload import task
from unload.support.compiled import compiled

# The equalized coordinate (2 r - (N-1)) / (N-1) by N and by twice the rank, which ties make
# odd. An item that is alone gets 0.
_LEVELS = np.zeros((task.N_VISIBLE + 1, 2 * task.N_VISIBLE - 1), np.float32)
for _items in range(2, task.N_VISIBLE + 1):
    _last = _items - 1
    _LEVELS[_items, : 2 * _last + 1] = (np.arange(2 * _last + 1) - _last) / _last


@compiled
def rank(values, ranks):
    """Fill ``ranks``, int32, of items: how many are smaller, or equal and before each."""
    ranks[:] = 0
    for j in range(len(values)):
        value = values[j]
        for i in range(len(values)):
            ranks[i] += np.int32((value < values[i]) | ((value == values[i]) & (j < i)))


@compiled
def replace(values, ranks, row, value):
    """Take the item in ``row`` out, move the later ones up, and add one at the end."""
    gone, last = ranks[row], len(values) - 1
    for i in range(row, last):
        values[i], ranks[i] = values[i + 1], ranks[i + 1]
    values[last] = value
    smaller = np.int32(0)
    for i in range(last):
        above = values[i] > value
        ranks[i] += np.int32(above) - np.int32(ranks[i] > gone)
        smaller += not above
    ranks[last] = smaller


@compiled
def remove(values, ranks, row):
    """Take the item in ``row`` out and move the later ones up; the last place is void then."""
    gone, last = ranks[row], len(values) - 1
    for i in range(row, last):
        values[i], ranks[i] = values[i + 1], ranks[i + 1]
    for i in range(last):
        ranks[i] -= np.int32(ranks[i] > gone)


@compiled
def _twice_shared_ranks(values, ranks, twice):
    """Fill ``twice`` by twice the mean rank of each run of tied values, see ``task``."""
    order = np.empty(len(values), np.int32)
    for i in range(len(values)):
        order[ranks[i]] = i
    first = 0
    for r in range(len(values)):
        if r + 1 == len(values) or values[order[r + 1]] - values[order[r]] > task.TIE_TOLERANCE:
            for member in range(first, r + 1):
                twice[order[member]] = first + r
            first = r + 1


@compiled
def features(values, ranks, equalize, average, observation, items):
    """Write an observation: the values themselves, or equalized; then padding.

    Args:
        values, ranks: (axes, rows) float32 and int32.
        equalize: write equalized ranks instead of the values.
        average: give tied items their mean rank; only with ``equalize``.
        observation: (rows, axes) float32, filled.
        items: how many of the rows, the first ones, hold an item.
    """
    twice, levels = np.empty(items, np.int32), _LEVELS[items]
    observation[items:] = task.PADDING

    # A tie is a run of neighbours on one axis, so each axis is equalized by itself.
    for axis in range(len(values)):
        if not equalize:
            for i in range(items):
                observation[i, axis] = values[axis, i]
            continue
        if average:
            _twice_shared_ranks(values[axis, :items], ranks[axis, :items], twice)
        else:
            for i in range(items):
                twice[i] = 2 * ranks[axis, i]
        for i in range(items):
            observation[i, axis] = levels[twice[i]]
