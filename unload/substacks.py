"""Loads: packages form substacks, substacks form walls, walls fill the container.

Sec. III-A and Fig. 3 of the paper. The figure is drawn on a grid whose cell is 0.3 of
its units; all numbers below count cells, so that every substack is exact. Neighbouring
substacks interlock like the steps of a stair: the columns start at 0, 6, 16 and 26
cells and together fill 36 cells of width, which we take to be the container's 2.5 m.
"""

from dataclasses import dataclass

import numpy as np

from unload import checks, task

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


@dataclass(frozen=True, repr=False, eq=False)  # arrays have no single truth value
class Load:
    """The boxes of one container, before anything is unloaded.

    Attributes:
        positions: (n, 3) float64, centre of each box in m, inside the container.
        sizes: (n, 3) float64, edge lengths along x, y and z in m, positive.
        packages: (n,) int64, package number (0–12 in the paper's loads).
        walls: (n,) int64, number of the item wall, 0 at the rear.

    Raises:
        TypeError: a field's dtype is not numeric.
        ValueError: a field's shape or a value is wrong, a box sticks out of the
            container, or two boxes overlap.
    """

    positions: np.ndarray
    sizes: np.ndarray
    packages: np.ndarray
    walls: np.ndarray

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
        _check_inside(positions, sizes)
        _check_disjoint(positions, sizes)
        for name, array in {"positions": positions, "sizes": sizes, **labels}.items():
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return len(self.positions)

    def __repr__(self) -> str:
        return f"Load({len(self)} items in {len(np.unique(self.walls))} walls)"


def _check_inside(positions: np.ndarray, sizes: np.ndarray, tolerance: float = 1e-6) -> None:
    low, high = positions - sizes / 2, positions + sizes / 2
    outside = ((low < -tolerance) | (high > task.CONTAINER + tolerance)).any(axis=1)
    if outside.any():
        item = int(np.argmax(outside))
        raise ValueError(
            f"box {item} reaches from {low[item]} to {high[item]} m; "
            f"expected it inside the container, [0 0 0] to {task.CONTAINER}"
        )


def _check_disjoint(positions: np.ndarray, sizes: np.ndarray, tolerance: float = 1e-6) -> None:
    low, high = positions - sizes / 2 + tolerance, positions + sizes / 2 - tolerance
    for slab in slabs(low[:, 0], high[:, 0]):
        overlap = np.ones((len(slab), len(slab)), dtype=bool)
        for axis in range(3):
            starts_before_end = low[slab, None, axis] < high[None, slab, axis]
            overlap &= starts_before_end & starts_before_end.T
        np.fill_diagonal(overlap, False)
        if overlap.any():
            first, second = (int(slab[i]) for i in np.argwhere(overlap)[0])
            raise ValueError(f"boxes {first} and {second} overlap; expected disjoint boxes")


def slabs(low: np.ndarray, high: np.ndarray) -> list[np.ndarray]:
    """Split intervals into groups between which there is no overlap, such as item walls.

    Args:
        low, high: (n,) start and end of each interval, for example along x.

    Returns:
        A list of index arrays that together hold each of 0 … n-1 once.
    """
    order = np.argsort(low, kind="stable")
    reach = np.maximum.accumulate(high[order])
    return np.split(order, np.flatnonzero(low[order][1:] >= reach[:-1]) + 1)


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
    variants = check_variants("variants", variants)
    return np.array(
        [
            (package, column_left + left, row * ROWS_HIGH + lower)
            for row, chosen in enumerate(variants)
            for (column_left, substacks), variant in zip(COLUMNS, chosen)
            for package, left, lower in substacks[variant]
        ]
    )


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
    cells = [wall_cells(wall) for wall in variants]
    walls = np.repeat(np.arange(len(cells)), [len(wall) for wall in cells])
    packages, left, lower = np.concatenate(cells).T
    width, height = PACKAGES[packages].T
    depth = task.CONTAINER[0] / len(cells)
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
