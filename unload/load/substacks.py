"""Loads: packages form substacks, substacks form walls, walls fill the container.

Sec. III-A and Fig. 3 of the paper. The figure is drawn on a grid whose cell is 0.3 of
its units; all numbers below count cells, so that every substack is exact. Neighbouring
substacks interlock like the steps of a stair, and the four of a row together fill 36 cells
of width, which we take to be the container's 2.5 m.
"""

import numpy as np

from unload import task
from unload.load.boxes import Load
from unload.support import checks

CELLS_WIDE = 36
CELLS_HIGH = 10  # of a row of substacks
CELL = task.CONTAINER[1] / CELLS_WIDE  # m
ROWS = 3  # bottom, mid, top
WALLS = 12  # not in the paper: gives 938 ± 40 items, nearly always in its range of 800–1000

# Width and height of packages 0–12, in cells (Fig. 3).
PACKAGES = np.array(
    [
        (10, 6), (6, 4), (4, 4), (6, 6), (7, 6), (3, 5), (3, 3),
        (3, 2), (6, 2), (4, 2), (6, 3), (5, 2), (2, 2),
    ]
)  # fmt: skip

# Variants 0, 1, 2 of each substack: (package, left edge, lower edge) in cells (Fig. 3).
LEFT = (
    ((12, 0, 8), (12, 2, 8), (12, 4, 8), (7, 0, 6), (7, 3, 6), (11, 0, 4), (11, 5, 4),
     (1, 0, 0), (2, 6, 0)),
    ((8, 0, 8), (6, 0, 5), (7, 3, 6), (5, 0, 0), (4, 3, 0)),
    ((1, 0, 6), (0, 0, 0)),
)  # fmt: skip
MID = (
    ((12, 0, 8), (12, 2, 8), (12, 4, 8), (12, 6, 8), (12, 8, 8), (9, 0, 6), (7, 4, 6),
     (7, 7, 6), (11, 4, 4), (11, 9, 4), (1, 4, 0), (2, 10, 0)),
    ((8, 0, 8), (9, 6, 8), (9, 0, 6), (6, 4, 5), (7, 7, 6), (5, 4, 0), (4, 7, 0)),
    ((1, 0, 6), (2, 6, 6), (0, 4, 0)),
)  # fmt: skip
RIGHT = (
    ((7, 0, 8), (12, 3, 8), (12, 5, 8), (7, 7, 8), (12, 0, 6), (9, 2, 6), (9, 6, 6),
     (6, 4, 3), (6, 7, 3), (10, 4, 0)),
    ((2, 0, 6), (6, 4, 7), (6, 7, 7), (10, 4, 4), (1, 4, 0)),
    ((1, 0, 6), (2, 6, 6), (3, 4, 0)),
)  # fmt: skip
# One row of a wall, from left to right: (left edge in cells, variants of the substack). A left
# substack's upper boxes end where the next one begins.
COLUMNS = ((0, LEFT), (6, MID), (16, MID), (26, RIGHT))
# _COUNTS[column, variant] is the number of items. _CELLS[column, variant, k] holds the package of
# item k, its left edge in the row and its lower edge; zeros where there are fewer items.
_COUNTS = np.array([[len(variant) for variant in variants] for _, variants in COLUMNS])
_CELLS = np.zeros((*_COUNTS.shape, _COUNTS.max(), 3), np.int64)
for _column, (_left, _variants) in enumerate(COLUMNS):
    for _number, _variant in enumerate(_variants):
        _CELLS[_column, _number, : len(_variant)] = np.array(_variant) + (0, _left, 0)


def build_load(variants: np.ndarray) -> Load:
    """The load with the given substacks.

    Args:
        variants: (walls, rows, 4) int, variant 0–2 of each substack, rear wall and bottom row
            first. The rows must fit into the container's height.

    Returns:
        The load, its walls filling the container from the rear to the entrance.

    Raises:
        TypeError, ValueError: an argument is not as described.
    """
    variants = checks.integer_array("variants", variants, (None, None, len(COLUMNS)), 2)
    if not variants.size:
        raise ValueError(f"variants has shape {variants.shape}; expected a wall and a row at least")
    columns = np.arange(len(COLUMNS))
    counts, cells = _COUNTS[columns, variants], _CELLS[columns, variants]  # (walls, rows, 4, …)
    filled = np.arange(cells.shape[3]) < counts[..., np.newaxis]  # (walls, rows, 4, m)
    walls, rows, _, _ = np.nonzero(filled)  # (n,) each, as of all that follows
    packages, left, low = cells[filled].T
    # Each box is a wall deep, and as many cells wide and high as its package. ``units`` are in m.
    edges = np.insert(PACKAGES, 0, 1, axis=1)[packages]
    units = np.array([task.CONTAINER[0] / (walls[-1] + 1), CELL, CELL])
    positions = (np.column_stack([walls, left, low + rows * CELLS_HIGH]) + edges / 2) * units
    return Load(positions, edges * units, packages, walls)


def stack_load(rng: np.random.Generator, walls: int = WALLS) -> Load:
    """Draw a random load (Sec. III-A): a variant for each substack of each wall.

    Args:
        rng: the source of randomness.
        walls: number of item walls. A load of 12 walls with fewer than 800 or more than 1000
            items is drawn anew, so that the paper's range is kept.

    Raises:
        TypeError, ValueError: an argument is not as described.
    """
    checks.generator("rng", rng)
    checks.integer("walls", walls, 1, 100)
    while True:
        load = build_load(rng.integers(3, size=(walls, ROWS, len(COLUMNS))))
        if walls != WALLS or task.MIN_ITEMS <= len(load) <= task.MAX_ITEMS:
            return load
