"""Loads: packages form substacks, substacks form walls, walls fill the container.

Sec. III-A and Fig. 3 of the paper. The figure is drawn on a grid whose cell is 0.3 of
its units; all numbers below count cells, so that every substack is exact. Neighbouring
substacks interlock like the steps of a stair, and the four of a row together fill 36 cells
of width, which we take to be the container's 2.5 m.

Boxes of another scale are not in the paper: they show how a policy fares elsewhere.
"""

from functools import cache

import numpy as np

from unload import task
from unload.load.boxes import Load
from unload.support import checks

CELLS_WIDE = 36
CELLS_HIGH = 10  # of a row of substacks
CELL = task.CONTAINER[1] / CELLS_WIDE  # m
ROWS = 3  # bottom, mid, top
WALLS = 12  # not in the paper: gives 938 ± 40 items, in its range of 800–1000
DEPTH = task.CONTAINER[0] / WALLS  # m, of each box of 12 walls

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
# Cells from a left substack to the next one, which begins where its upper boxes end; and from
# each other one.
_LEFT_STEP, _OTHER_STEP = 6, 10


def _columns(count: int) -> list[tuple[int, tuple]]:
    """One row of a wall, from left to right: (left edge in cells, variants of the substack)."""
    edges = [0, *(_LEFT_STEP + _OTHER_STEP * number for number in range(count - 1))]
    return list(zip(edges, (LEFT, *[MID] * (count - 2), RIGHT)))


COLUMNS = _columns(4)


@cache
def _row(columns: int) -> tuple[np.ndarray, np.ndarray]:
    """A row with one left substack, ``columns - 2`` mid ones and one right one, in arrays.

    (columns, 3) int64, the number of items of each variant; and (columns, 3, m, 3) int64, each
    item's package, left edge in the row and lower edge, filled up with zeros.
    """
    substacks = _columns(columns)
    counts = np.array([[len(variant) for variant in variants] for _, variants in substacks])
    cells = np.zeros((*counts.shape, counts.max(), 3), np.int64)
    for column, (left, variants) in enumerate(substacks):
        for number, variant in enumerate(variants):
            cells[column, number, : len(variant)] = np.array(variant) + (0, left, 0)
    return counts, cells


def _substacks_that_fit(scale: float = 1.0) -> tuple[int, int, int]:
    """Walls, rows and columns of substacks of a full container; 12, 3 and 4 at scale 1."""
    cells = CELLS_WIDE / checks.real("scale", scale, 0.5, 1.5) + 1e-9  # across and up
    columns = 1 + int((cells - _LEFT_STEP) / _OTHER_STEP)
    return round(WALLS / scale), int(cells / CELLS_HIGH), columns


def build_load(variants: np.ndarray, scale: float = 1.0) -> Load:
    """The load with the given substacks.

    Args:
        variants: (walls, rows, columns) int, variant 0–2 of each substack, rear wall and
            bottom row first. There are as many columns as fit, 4 at scale 1; the rows must fit
            into the container's height, too.
        scale: of the boxes' widths and heights, 0.5 to 1.5. Their depth is that of the walls.

    Returns:
        The load, its walls filling the container from the rear to the entrance. They begin
        at y = 0 and, except at scale 1, leave a gap at the other side wall.

    Raises:
        TypeError, ValueError: an argument is not as described.
    """
    columns = _substacks_that_fit(scale)[2]
    variants = checks.integer_array("variants", variants, (None, None, columns), 2)
    if not variants.size:
        raise ValueError(f"variants has shape {variants.shape}; expected a wall and a row at least")
    counts, cells = (each[np.arange(columns), variants] for each in _row(columns))
    filled = np.arange(cells.shape[3]) < counts[..., np.newaxis]
    walls, rows, _, _ = np.nonzero(filled)
    packages, left, low = cells[filled].T
    # In walls and cells, and in m: a wall is as deep as each of its boxes.
    edges = np.insert(PACKAGES, 0, 1, axis=1)[packages]
    units = np.array([task.CONTAINER[0] / (walls[-1] + 1), CELL * scale, CELL * scale])
    positions = (np.column_stack([walls, left, low + rows * CELLS_HIGH]) + edges / 2) * units
    return Load(positions, edges * units, packages, walls)


def stack_load(rng: np.random.Generator, walls: int | None = None, scale: float = 1.0) -> Load:
    """Draw a random load (Sec. III-A): a variant for each substack of each wall.

    Args:
        rng: the source of randomness.
        walls: number of item walls; by default as many as keep the boxes' proportions, 12
            at scale 1. A load of 12 walls at scale 1 with fewer than 800 or more than 1000
            items is drawn anew, so that the paper's range is kept.
        scale: of the boxes, 0.5 to 1.5, see ``build_load``. The container stays as it is:
            it holds more substacks of small boxes, 15 walls × 4 rows × 4 columns at 0.8
            with a gap of 0.5 m, and fewer of large ones, 10 × 3 × 3 at 1.2 with a gap of
            0.33 m.

    Raises:
        TypeError, ValueError: an argument is not as described.
    """
    checks.generator("rng", rng)
    most, rows, columns = _substacks_that_fit(scale)
    walls = most if walls is None else checks.integer("walls", walls, 1, 100)
    while True:
        load = build_load(rng.integers(3, size=(walls, rows, columns)), scale)
        of_the_paper = scale == 1 and walls == WALLS
        if not of_the_paper or task.MIN_ITEMS <= len(load) <= task.MAX_ITEMS:
            return load
