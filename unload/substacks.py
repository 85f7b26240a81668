"""Loads: packages form substacks, substacks form walls, walls fill the container.

Sec. III-A and Fig. 3 of the paper. The figure is drawn on a grid whose cell is 0.3 of
its units; all numbers below count cells, so that every substack is exact. Neighbouring
substacks interlock like the steps of a stair: the columns start at 0, 6, 16 and 26
cells and together fill 36 cells of width, which we take to be the container's 2.5 m.
"""

from dataclasses import dataclass, field

import numba
import numpy as np

from unload import checks, task
from unload.boxes import Contacts, contacts

CELLS_WIDE = 36
ROWS_HIGH = 10  # cells of height per row of substacks
CELL = task.CONTAINER[1] / CELLS_WIDE  # m
ROWS = 3  # bottom, mid, top
WALLS = 12  # not in the paper: gives 938 ± 40 items, in its range of 800–1000
DEPTH = task.CONTAINER[0] / WALLS  # m, the same for every item

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
# One row of a wall, from left to right: (left edge in cells, variants of the substack).
COLUMNS = ((0, LEFT), (6, MID), (16, MID), (26, RIGHT))
# The same in arrays for compiled code, by column and variant, filled up with zeros: package,
# left edge in the row and lower edge of each item; and the number of items.
COUNTS = np.array([[len(variant) for variant in substacks] for _, substacks in COLUMNS])
CELLS = np.zeros((*COUNTS.shape, COUNTS.max(), 3), np.int64)
for _column, (_left, _substacks) in enumerate(COLUMNS):
    for _number, _variant in enumerate(_substacks):
        CELLS[_column, _number, : len(_variant)] = np.array(_variant) + (0, _left, 0)


@dataclass(frozen=True, repr=False, eq=False)  # arrays have no single truth value
class Load:
    """The boxes of one container, before anything is unloaded.

    Attributes:
        positions: (n, 3) float64, centre of each box in m, inside the container.
        sizes: (n, 3) float64, edge lengths along x, y and z in m, positive.
        packages: (n,) int64, package number (0–12 in the paper's loads).
        walls: (n,) int64, number of the item wall, 0 at the rear.
        contacts: which boxes touch, found from the others.

    Raises:
        TypeError: a field's dtype is not numeric.
        ValueError: a field's shape or a value is wrong, a box sticks out of the
            container, or two boxes overlap.
    """

    positions: np.ndarray
    sizes: np.ndarray
    packages: np.ndarray
    walls: np.ndarray
    contacts: Contacts = field(init=False)

    def __post_init__(self) -> None:
        positions = checks.finite_array("positions", self.positions, (None, 3))
        count = len(positions)
        if count == 0:
            raise ValueError("positions is empty; expected at least one box")
        sizes = checks.finite_array("sizes", self.sizes, (count, 3))
        if (sizes <= 0).any():
            item = int(np.argwhere(sizes <= 0)[0, 0])
            raise ValueError(f"sizes of box {item} are {sizes[item]}; expected all > 0")
        labels = {}
        for name in ("packages", "walls"):
            labels[name] = checks.integer_array(name, getattr(self, name), (count,))
            if (labels[name] < 0).any():
                raise ValueError(f"{name} holds {labels[name].min()}; expected numbers >= 0")
        low, high = positions - sizes / 2, positions + sizes / 2
        _check_inside(low, high)
        object.__setattr__(self, "contacts", contacts(low, high))
        for name, array in {"positions": positions, "sizes": sizes, **labels}.items():
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return len(self.positions)

    def __repr__(self) -> str:
        return f"Load({len(self)} items in {len(np.unique(self.walls))} walls)"


def _check_inside(low: np.ndarray, high: np.ndarray, tolerance: float = 1e-6) -> None:
    if low.min() >= -tolerance and (high.max(axis=0) <= task.CONTAINER + tolerance).all():
        return
    outside = ((low < -tolerance) | (high > task.CONTAINER + tolerance)).any(axis=1)
    item = int(np.argmax(outside))
    raise ValueError(
        f"box {item} reaches from {low[item]} to {high[item]} m; "
        f"expected it inside the container, [0 0 0] to {task.CONTAINER}"
    )


def check_variants(name: str, variants: object) -> np.ndarray:
    """Return ``variants`` as a (rows, 4) int64 array.

    Raises:
        TypeError: it does not hold integers.
        ValueError: another shape, no rows, or an unknown variant.
    """
    variants = checks.integer_array(name, variants, (None, len(COLUMNS)))
    if not len(variants):
        raise ValueError(f"{name} has no rows; expected at least one")
    if not (0 <= variants.min() and variants.max() <= 2):
        raise ValueError(f"{name} holds {variants.min()} to {variants.max()}; expected 0 to 2")
    return variants


def wall_cells(variants: np.ndarray) -> np.ndarray:
    """One item wall on the grid.

    Args:
        variants: (rows, 4) int, variant 0–2 of each substack, bottom row first.

    Returns:
        (n, 3) int64: package number, left edge and lower edge of each item in cells.

    Raises:
        TypeError, ValueError: see ``check_variants``.
    """
    return _cells(check_variants("variants", variants)[np.newaxis])[:, 1:]


@numba.njit(cache=True)
def _cells(variants):
    """Items of (walls, rows, 4) variants, (n, 4) int64: wall, package, left and lower edge."""
    walls, rows, columns = variants.shape
    cells, count = np.empty((variants.size * CELLS.shape[2], 4), np.int64), 0
    for wall in range(walls):
        for row in range(rows):
            for column in range(columns):
                variant = variants[wall, row, column]
                for number in range(COUNTS[column, variant]):
                    package, left, lower = CELLS[column, variant, number]
                    cells[count] = wall, package, left, lower + row * ROWS_HIGH
                    count += 1
    return cells[:count].copy()


def build_load(variants: np.ndarray) -> Load:
    """The load with the given substacks.

    Args:
        variants: (walls, rows, 4) int, variant 0–2 of each substack, rear wall and
            bottom row first.

    Returns:
        The load, its walls filling the container from the rear to the entrance.

    Raises:
        TypeError, ValueError: see ``check_variants``; there must be a wall, too.
    """
    variants = checks.integer_array("variants", variants, (None, None, len(COLUMNS)))
    if not len(variants):
        raise ValueError("variants has no walls; expected at least one")
    check_variants("variants", variants.reshape(-1, len(COLUMNS)))
    walls, packages, left, lower = _cells(variants).T
    width, height = PACKAGES[packages].T
    depth = task.CONTAINER[0] / len(variants)
    positions = np.column_stack(
        [(walls + 0.5) * depth, (left + width / 2) * CELL, (lower + height / 2) * CELL]
    )
    sizes = np.column_stack([np.full(len(walls), depth), width * CELL, height * CELL])
    return Load(positions, sizes, packages, walls)


def stack_load(rng: np.random.Generator, walls: int = WALLS) -> Load:
    """Draw a random load (Sec. III-A): a variant for each substack of each wall.

    Args:
        rng: the source of randomness.
        walls: number of item walls; with the default 12 a load of fewer than 800 or
            more than 1000 items is drawn anew, so that the paper's range is kept.

    Raises:
        TypeError: ``rng`` is not a ``numpy.random.Generator``.
    """
    checks.generator("rng", rng)
    checks.integer("walls", walls, 1, 100)
    while True:
        load = build_load(rng.integers(3, size=(walls, ROWS, len(COLUMNS))))
        if walls != WALLS or task.MIN_ITEMS <= len(load) <= task.MAX_ITEMS:
            return load
