"""Loads: packages form substacks, substacks form walls, walls fill the container.

Sec. III-A and Fig. 3 of the paper. The figure is drawn on a grid whose cell is 0.3 of
its units; all numbers below count cells, so that every substack is exact. Neighbouring
substacks interlock like the steps of a stair: the columns start at 0, 6, 16 and 26
cells and together fill 36 cells of width, which we take to be the container's 2.5 m.

Boxes of another scale, and the front of a load alone, are not in the paper: they show how
a policy fares elsewhere, and make a simulation of all boxes affordable.
"""

from functools import cache

import numpy as np

from unload import task
from unload.load.boxes import Load
from unload.support import checks
from unload.support.compiled import compiled

CELLS_WIDE = 36
ROWS_HIGH = 10  # cells of height per row of substacks
CELL = task.CONTAINER[1] / CELLS_WIDE  # m
ROWS = 3  # bottom, mid, top
WALLS = 12  # not in the paper: gives 938 ± 40 items, in its range of 800–1000
DEPTH = task.CONTAINER[0] / WALLS  # m, the same for every item
FRONT_WALLS = 7  # hold the boxes seen during 100 picks, and a spare wall, see ``front_walls``

# Width and height of packages 0–12, in cells (Fig. 3).
PACKAGES = np.array(
    [
        (10, 6), (6, 4), (4, 4), (6, 6), (7, 6), (3, 5), (3, 3),
        (3, 2), (6, 2), (4, 2), (6, 3), (5, 2), (2, 2),
    ]
)  # fmt: skip

# Packages 0–12 as RGB in [0, 1]: large packages dark, small ones light.
PACKAGE_COLOURS = tuple(
    (int(code[:2], 16) / 255, int(code[2:4], 16) / 255, int(code[4:], 16) / 255)
    for code in (
        "1f3a5f", "2e6f95", "5fa8d3", "264d3b", "3f8f63", "7a3b69", "c05299",
        "e07a5f", "b5838d", "f2b880", "8d6a9f", "d4a373", "f6e27f",
    )
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
# One row of a wall, from left to right: (left edge in cells, variants of the substack).
COLUMNS = ((0, LEFT), (6, MID), (16, MID), (26, RIGHT))
MID_CELLS = 10  # width that each further mid substack adds to a row
ENDS_CELLS = 16  # width of a row of a left and a right substack only
SCALES = 0.5, 1.5  # smallest and largest scale of the boxes


def package_colour(package: int) -> tuple[float, float, float]:
    """RGB of a package; numbers above 12 start again from 0."""
    return PACKAGE_COLOURS[package % len(PACKAGE_COLOURS)]


def check_variants(variants: object, columns: int = len(COLUMNS)) -> np.ndarray:
    """Return ``variants`` as a (rows, columns) int64 array.

    Raises:
        TypeError: it does not hold integers.
        ValueError: another shape, no rows, or an unknown variant.
    """
    variants = checks.integer_array("variants", variants, (None, columns))
    if not len(variants):
        raise ValueError("variants has no rows; expected at least one")
    if not (0 <= variants.min() and variants.max() <= 2):
        raise ValueError(f"variants holds {variants.min()} to {variants.max()}; expected 0 to 2")
    return variants


def wall_cells(variants: np.ndarray) -> np.ndarray:
    """One item wall on the grid.

    Args:
        variants: (rows, 4) int, variant 0–2 of each substack, bottom row first.

    Returns:
        (n, 3) int64: package number, left edge and lower edge of each item in cells.
    """
    variants = check_variants(variants)
    return _cells(variants[np.newaxis], *_row(len(COLUMNS)))[:, 1:]


@cache
def _row(columns: int) -> tuple[np.ndarray, np.ndarray]:
    """A row with one left substack, ``columns - 2`` mid ones and one right one, in arrays.

    Returns:
        (columns, 3) int64, the number of items of each variant; and (columns, 3, m, 3)
        int64, each item's package, left edge in the row and lower edge, filled up with zeros.
    """
    substacks = (LEFT, *[MID] * (columns - 2), RIGHT)
    counts = np.array([[len(variant) for variant in variants] for variants in substacks])
    cells = np.zeros((*counts.shape, counts.max(), 3), np.int64)
    for column, variants in enumerate(substacks):
        left = 0 if column == 0 else COLUMNS[1][0] + MID_CELLS * (column - 1)
        for number, variant in enumerate(variants):
            cells[column, number, : len(variant)] = np.array(variant) + (0, left, 0)
    return counts, cells


@compiled
def _cells(variants, counts, cells):
    """Items of (walls, rows, columns) variants, (n, 4) int64: wall, package, left and lower edge.

    Args:
        variants: of each substack.
        counts, cells: what ``_row`` returned.
    """
    walls, rows, columns = variants.shape
    found, total = np.empty((variants.size * cells.shape[2], 4), np.int64), 0
    for wall in range(walls):
        for row in range(rows):
            for column in range(columns):
                variant = variants[wall, row, column]
                for number in range(counts[column, variant]):
                    # One by one, here and below: a row at once takes two seconds more to compile.
                    found[total, 0] = wall
                    for part in range(3):
                        found[total, 1 + part] = cells[column, variant, number, part]
                    found[total, 3] += row * ROWS_HIGH
                    total += 1
    return found[:total].copy()


def substacks_that_fit(scale: float = 1.0) -> tuple[int, int, int]:
    """Walls, rows and columns of substacks of a full container; 12, 3 and 4 at scale 1.

    Args:
        scale: of all edges of the boxes, 0.5 to 1.5.
    """
    cells = CELLS_WIDE / checks.real("scale", scale, *SCALES) + 1e-9  # the width; the height
    mids = int((cells - ENDS_CELLS) / MID_CELLS)
    return round(WALLS / scale), int(cells / ROWS_HIGH), 2 + mids


def build_load(variants: np.ndarray, scale: float = 1.0) -> Load:
    """The load with the given substacks.

    Args:
        variants: (walls, rows, columns) int, variant 0–2 of each substack, rear wall and
            bottom row first. The number of columns is that of ``substacks_that_fit``: 4
            at scale 1.
        scale: of the boxes' widths and heights. Their depth is that of the walls.

    Returns:
        The load, its walls filling the container from the rear to the entrance. They begin
        at y = 0 and, except at scale 1, leave a gap at the other side wall.

    Raises:
        TypeError, ValueError: see ``check_variants`` and ``substacks_that_fit``; there must
            be a wall, too, and the rows must fit into the container's height.
    """
    columns = substacks_that_fit(scale)[2]
    variants = checks.integer_array("variants", variants, (None, None, columns))
    if not len(variants):
        raise ValueError("variants has no walls; expected at least one")
    check_variants(variants.reshape(-1, columns), columns)
    cells = _cells(variants, *_row(columns))
    positions, sizes = _boxes(cells, PACKAGES, task.CONTAINER[0] / len(variants), CELL * scale)
    return Load(positions, sizes, cells[:, 1], cells[:, 0])


@compiled
def _boxes(cells, packages, depth, cell):
    """Centres and edge lengths of items in m, both (n, 3) float64.

    Args:
        cells: what ``_cells`` returned.
        packages: ``PACKAGES``.
        depth, cell: of a wall and of a cell, in m.
    """
    positions, sizes = np.empty((len(cells), 3)), np.empty((len(cells), 3))
    for item, (wall, package, left, lower) in enumerate(cells):
        width, height = packages[package]
        positions[item, 0], sizes[item, 0] = (wall + 0.5) * depth, depth
        positions[item, 1], sizes[item, 1] = (left + width / 2) * cell, width * cell
        positions[item, 2], sizes[item, 2] = (lower + height / 2) * cell, height * cell
    return positions, sizes


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
        TypeError: ``rng`` is not a ``numpy.random.Generator``.
        TypeError, ValueError: ``walls`` or ``scale`` is not as described.
    """
    checks.generator("rng", rng)
    most, rows, columns = substacks_that_fit(scale)
    walls = most if walls is None else checks.integer("walls", walls, 1, 100)
    while True:
        load = build_load(rng.integers(3, size=(walls, rows, columns)), scale)
        of_the_paper = scale == 1 and walls == WALLS
        if not of_the_paper or task.MIN_ITEMS <= len(load) <= task.MAX_ITEMS:
            return load


def front_walls(load: Load, count: int = FRONT_WALLS) -> Load:
    """The ``count`` item walls nearest to the entrance, where they stand; no others.

    Of a load of the paper, all boxes that are seen during the first 100 picks are in the
    front 6 walls, whatever is picked: the nearest 228 are. With a seventh wall behind them,
    ``full`` physics is nearly twice as fast as with all.
    """
    walls = np.unique(load.walls)
    kept = load.walls >= walls[-checks.integer("count", count, 1, len(walls))]
    return Load(load.positions[kept], load.sizes[kept], load.packages[kept], load.walls[kept])
