"""Loads that never repeat, of four families: of some 300 boxes, each of a size of its own.

Their joints are real numbers, so that no situation is met twice. ``FAMILIES`` has them by name.
"""

from collections.abc import Callable
from itertools import accumulate, chain

import numpy as np

import unload
from unload import task

LENGTH, WIDTH, HEIGHT = task.CONTAINER.tolist()
STACKED = 0.9 * HEIGHT  # m, so high at most
DEPTHS, WIDTHS, HEIGHTS = (0.6, 1.0), (0.25, 0.6), (0.15, 0.4)  # of boxes and walls, in m
ACROSS = 5, 9  # boxes side by side in a layer, fewer than the second number
PALLET = (1.0, 1.3), (0.7, 1.2)  # depth and width of a pallet, in m
SMALLEST = 0.15  # m, an edge of a box upon an eccentric column


def columns(rng: np.random.Generator) -> unload.Load:
    """Walls of columns, in each of which all boxes have the same footprint."""
    boxes = []
    for depth in _cut(rng, LENGTH, DEPTHS):
        for side in _cut(rng, WIDTH, WIDTHS):
            boxes += [(depth, side, layer) for layer in _cut(rng, STACKED, HEIGHTS)]
    return _load(boxes)


def eccentric(rng: np.random.Generator) -> unload.Load:
    """Columns in which each box stands somewhere on the one below, and is no larger."""
    boxes = []
    for depth in _cut(rng, LENGTH, DEPTHS):
        for side in _cut(rng, WIDTH, WIDTHS):
            place = depth, side
            for layer in _cut(rng, STACKED, HEIGHTS):
                boxes.append((*place, layer))
                place = tuple(_part(rng, *each) for each in place)
    return _load(boxes)


def bricked(rng: np.random.Generator) -> unload.Load:
    """Walls of layers whose joints lie anywhere."""
    boxes = []
    for depth in _cut(rng, LENGTH, DEPTHS):
        for layer in _cut(rng, STACKED, HEIGHTS):
            sides = _divided(rng, 0.0, WIDTH, rng.integers(*ACROSS))
            boxes += [(depth, side, layer) for side in sides]
    return _load(boxes)


def crossed(rng: np.random.Generator) -> unload.Load:
    """Pallets of layers, which are divided lengthwise and crosswise by turns."""
    size, boxes = [rng.uniform(*edges) for edges in PALLET], []
    for depth in range(int(LENGTH / size[0])):
        for side in range(int(WIDTH / size[1])):
            for turn, layer in enumerate(_cut(rng, STACKED, HEIGHTS)):
                counts = [rng.integers(2, 4), rng.integers(1, 3)][:: 1 if turn % 2 else -1]
                along, across = (
                    _divided(rng, first * edge, edge, count)
                    for first, edge, count in zip((depth, side), size, counts)
                )
                boxes += [(one, other, layer) for one in along for other in across]
    return _load(boxes)


FAMILIES: dict[str, Callable[[np.random.Generator], unload.Load]] = {
    "columns": columns,
    "eccentric columns": eccentric,
    "bricked walls": bricked,
    "crossed layers": crossed,
}

Interval = tuple[float, float]


def _cut(rng: np.random.Generator, end: float, steps: Interval) -> list[Interval]:
    """Neighbouring intervals of random lengths from 0 on that end before ``end``."""
    ends = [0.0]
    while True:
        step = rng.uniform(*steps)
        if ends[-1] + step > end:
            return list(zip(ends, ends[1:]))
        ends.append(ends[-1] + step)


def _divided(rng: np.random.Generator, first: float, length: float, count: int) -> list[Interval]:
    """An interval in so many neighbouring ones, of which none is twice as long as another."""
    ends = [0.0, *accumulate(rng.uniform(1.0, 2.0, count).tolist())]
    scale = length / ends[-1]
    ends = [first + scale * end for end in ends]
    return list(zip(ends, ends[1:]))


def _part(rng: np.random.Generator, first: float, last: float) -> Interval:
    """Some interval within another one."""
    length = min(last - first, max(SMALLEST, rng.uniform(0.5, 1.0) * (last - first)))
    low = first + rng.random() * (last - first - length)
    return low, low + length


def _load(boxes: list[tuple[Interval, Interval, Interval]]) -> unload.Load:
    """The load of boxes by their intervals along x, y and z, in m."""
    flat = np.fromiter(chain.from_iterable(chain.from_iterable(boxes)), float, 6 * len(boxes))
    low, high = flat.reshape(-1, 3, 2).transpose(2, 0, 1)
    return unload.Load((low + high) / 2, high - low)
