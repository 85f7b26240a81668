"""Histogram equalization of an observation (Alg. 1, Tab. I)."""

import numpy as np

from unload import task
from unload.support import checks

TIES = ("noise", "average")


def equalize(
    positions: np.ndarray,
    ties: str = "noise",
    present: np.ndarray | None = None,
) -> np.ndarray:
    """Replace each coordinate by its rank among the items, spread evenly over [-1, 1].

    The item of rank r = 0 … N-1 along an axis gets (2 r - (N-1)) / (N-1): the order of the
    items stays, their distances become equal (Alg. 1; Tab. I counts ranks from 1). An item
    that is alone gets 0.

    Args:
        positions: (..., items, axes) float, at least two items.
        ties: ranks of items at the same height (or depth, or width).
            ``"noise"``: each has a rank of its own, as in the paper, where the
            simulator's inaccuracy decides among them; exactly equal values are ranked
            in the order of the items. ``"average"``: items whose sorted neighbours
            differ by at most 0.005 share the mean of their ranks.
        present: (..., items) bool, the rows that hold an item; all if None. The others do
            not count among the N items and get ``task.PADDING``, -1.

    Returns:
        Same shape, float32 in [-1, 1].

    Raises:
        TypeError: ``positions`` does not hold numbers, or ``present`` no flags.
        ValueError: fewer than two rows, a value that is not finite, an unknown ``ties``, or
            ``present`` is of another shape.
    """
    checks.one_of("ties", ties, TIES)
    positions = np.asarray(positions)
    if positions.ndim < 2 or positions.shape[-2] < 2:
        raise ValueError(
            f"positions has shape {positions.shape}; expected (..., items, axes), items >= 2"
        )
    checks.finite_array("positions", positions, (None,) * positions.ndim)

    # Rows without an item come after all others, and the last rank is that of the last item.
    last = positions.shape[-2] - 1
    if present is not None:
        present = checks.flag_array("present", present, positions.shape[:-1])[..., np.newaxis]
        positions = np.where(present, positions, np.inf)  # sorted behind the items
        last = present.sum(axis=-2, keepdims=True) - 1

    # Sorting twice would give ranks, too; writing 0, 1, 2 … into the sorted places is faster.
    order = np.argsort(positions, axis=-2, kind="stable")
    sorted_ranks = np.arange(positions.shape[-2], dtype=np.float64)[:, None]
    if ties == "average":
        sorted_ranks = _shared_ranks(np.take_along_axis(positions, order, axis=-2))
    ranks = np.empty(positions.shape)
    np.put_along_axis(ranks, order, sorted_ranks, axis=-2)

    even = (2 * ranks - last) / np.maximum(last, 1)
    return (even if present is None else np.where(present, even, task.PADDING)).astype(np.float32)


def _shared_ranks(ordered: np.ndarray) -> np.ndarray:
    """The mean rank of each run of tied values; ``ordered`` is sorted on axis -2.

    A run goes on while neighbours differ by at most ``task.TIE_TOLERANCE``.
    """
    items = ordered.shape[-2]
    index = np.broadcast_to(np.arange(items)[:, None], ordered.shape)
    # Whether a run begins with an item, and whether one ends with it.
    opens = np.ones(ordered.shape, dtype=bool)
    with np.errstate(invalid="ignore"):  # inf - inf, between rows without an item
        opens[..., 1:, :] = np.diff(ordered, axis=-2) > task.TIE_TOLERANCE
    closes = np.ones(ordered.shape, dtype=bool)
    closes[..., :-1, :] = opens[..., 1:, :]
    # Of each item, where its run begins (the last beginning so far), and where it ends.
    first = np.maximum.accumulate(np.where(opens, index, 0), axis=-2)
    reverse = np.where(closes, index, items - 1)[..., ::-1, :]
    last = np.minimum.accumulate(reverse, axis=-2)[..., ::-1, :]
    return (first + last) / 2
