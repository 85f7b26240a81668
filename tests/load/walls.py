"""Loads that are not the paper's."""

import numpy as np

from unload import task
from unload.load.boxes import (
    CONTACT_TOLERANCE,
    OVERLAP,
    BoxError,
    Load,
    check_no_overhang,
    check_supported,
)

# Drawn for each box: depth of its wall, width, height, in m.
CONTINUOUS = ((0.3, 0.9), (0.1, 0.6), (0.08, 0.45))
FEW_SIZES = ((0.5,), (0.2, 0.3, 0.4, 0.5), (0.2, 0.3))
MEASURED = 0.003  # m, heights of boxes side by side may differ by so much
KINDS = ("continuous sizes", "narrow gaps", "few sizes", "measured heights")


def of_corners(low: np.ndarray, sizes: np.ndarray, **fields) -> Load:
    """The load of boxes that are given by their corners nearest to the origin, (n, 3) in m."""
    return Load(np.array(low) + np.array(sizes) / 2, sizes, **fields)


def own_load(rng: np.random.Generator, kind: str) -> Load:
    """A full container of one of ``KINDS``.

    Narrow gaps are 0.3 µm to 3 mm at either side, and up to the tolerance of a contact above;
    some are overlaps that a load allows. Of measured heights some end below the box upon them.
    """
    low, high, walls = [], [], []
    for wall, (x0, x1) in enumerate(_cut(rng, kind, 0)):
        layers = rng.random() < 0.7
        for first in _cut(rng, kind, 2 if layers else 1):
            for second in _cut(rng, kind, 1 if layers else 2):  # anew in each layer
                (y0, y1), (z0, z1) = (second, first) if layers else (first, second)
                low.append((x0, y0, z0))
                high.append((x1, y1, z1))
                walls.append(wall)
    low, high = np.array(low), np.array(high)
    if kind == "narrow gaps":
        gaps = 10 ** rng.uniform(-6.5, -2.5, (2, len(low))) - 0.4 * OVERLAP
        low[:, 1] = np.maximum(low[:, 1] + gaps[0], 0)
        high[:, 1] = np.minimum(high[:, 1] - gaps[1], task.CONTAINER[1])
        high[:, 2] -= rng.uniform(-0.4 * OVERLAP, 0.9 * CONTACT_TOLERANCE, len(low))
    tolerance = CONTACT_TOLERANCE
    if kind == "measured heights":
        tolerance, high[:, 2] = MEASURED, high[:, 2] - rng.uniform(0, 0.9 * MEASURED, len(low))
    walls = np.array(walls)
    while True:  # beyond the end of a layer below, boxes of the next one would float
        labels = {"packages": np.zeros(len(low), int), "walls": walls}
        load = Load((low + high) / 2, high - low, **labels, contact_tolerance=tolerance)
        try:
            check_supported(load)
            check_no_overhang(load)
            return load
        except BoxError as error:
            low, high, walls = (np.delete(each, error.boxes, axis=0) for each in (low, high, walls))


def _cut(rng: np.random.Generator, kind: str, axis: int) -> list[tuple[float, float]]:
    """Neighbouring intervals that fit into the container along an axis, from 0.

    Above the highest there is room for a pick.
    """
    ends, most = [0.0], task.CONTAINER[axis] - (0.25 if axis == 2 else 0)
    while True:
        if kind == "few sizes":
            step = rng.choice(FEW_SIZES[axis])
        else:
            step = rng.uniform(*CONTINUOUS[axis])
        if ends[-1] + step > most:
            return list(zip(ends, ends[1:]))
        ends.append(ends[-1] + step)


def crossed_bars(count: int) -> Load:
    """Bars side by side, and as many across them, each on all of the first."""
    places, ones = (np.arange(count) + 0.5) / count, np.ones(count)
    along = np.column_stack([3.5 * ones, 2.5 * places, 0.15 * ones])
    across = np.column_stack([7 * places, 1.25 * ones, 0.45 * ones])
    sizes = np.repeat([[7, 2.5 / count, 0.3], [7 / count, 2.5, 0.3]], count, axis=0)
    return Load(np.vstack([along, across]), sizes)
