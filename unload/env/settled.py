"""The drift of boxes that a simulator has let settle, drawn from walls that were simulated once.

To settle a load takes seconds, and training draws tens of thousands of loads. Therefore
``data/settled.npz`` keeps how far the boxes of some hundred walls have moved, and a load's drift
is put together from it, one column of a wall at a time. A column is the three substacks that
stand one upon the other; how its boxes sink depends above all on which variants these are.

The drift tells which boxes can be lifted. Of two visible boxes at one height, after 300 random
picks, the liftable one has sunk less in 75 % of the pairs (63 to 85 % in each of ten loads); a
simulation of what is left gives 62 to 80 % (solutions of notebook 04).
"""

from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from unload.load.boxes import Load
from unload.load.substacks import COLUMNS, ROWS
from unload.support import checks, files
from unload.support.compiled import compiled

UNIT = 1e-6  # m, of the offsets on disk
TRIPLES = 3**ROWS  # kinds of a column: the variant of each of its substacks
PATH = files.DATA / "settled.npz"
# Of each column's three variants: the package of its first box, and how many boxes it has.
FIRST = np.array([[variant[0][0] for variant in variants] for _, variants in COLUMNS])
COUNTS = np.array([[len(variant) for variant in variants] for _, variants in COLUMNS])


class Settled(NamedTuple):
    """How far the boxes of simulated columns moved when they settled.

    Attributes:
        starts: (columns, kinds, samples + 1) int64, where the boxes of each sample begin in
            ``offsets``, and, last, where those of the last one end. ``kinds`` counts the
            variants of the lower, middle and upper substack as the digits of a number to base 3.
        offsets: (boxes, 4) float64, m: along x, y and z in the full load, and along z once
            nothing rests on the box any more.
    """

    starts: np.ndarray
    offsets: np.ndarray


def read_settled(path: str | Path) -> Settled:
    """Read the columns that ``unload.reproduce.drift`` has simulated.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is damaged or holds something else.
    """
    if not Path(path).is_file():
        raise FileNotFoundError(f"{path} is missing; python -m unload.reproduce drift makes it")
    stored = files.read_arrays(path)
    checks.entries(str(path), stored, ("counts", "offsets"))
    counts, offsets = stored["counts"], stored["offsets"]
    shape = (len(COLUMNS), TRIPLES, None)
    counts = checks.integer_array(f"{path}: counts", counts, shape)
    offsets = checks.integer_array(f"{path}: offsets", offsets, (int(counts.sum()), 4))
    ends = counts.cumsum().reshape(counts.shape)
    return Settled(np.concatenate([(ends - counts)[..., :1], ends], axis=2), offsets * UNIT)


@cache
def shared_settled() -> Settled:
    """The columns in ``data/settled.npz``."""
    return read_settled(PATH)


def settled_drift(load: Load, rng: np.random.Generator, settled: Settled) -> np.ndarray:
    """Draw how far each box of a load has moved.

    For each column of each wall, one of the simulated columns of the same variants at the same
    place in the wall is drawn. Boxes that rest on two columns move as those of their own do.

    Args:
        load: of ``stack_load`` at scale 1.
        rng: draws the columns.
        settled: the simulated columns.

    Returns:
        (n, 4) float64 in m, columns as in ``Settled.offsets``.

    Raises:
        ValueError: the load is not of the paper's substacks.
    """
    kinds, columns, numbers = columns_of(load)
    samples = rng.integers(settled.starts.shape[2] - 1, size=kinds.shape)
    starts = settled.starts[np.arange(kinds.shape[1]), kinds, samples]  # (walls, columns)
    return settled.offsets[starts.reshape(-1)[columns] + numbers]


def columns_of(load: Load) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The columns that a load is made of.

    Args:
        load: of ``stack_load`` at scale 1.

    Returns:
        ``kinds``: (walls, columns) int64, see ``Settled``; ``columns``: (n,) int64, the column
        of each box, counted through all walls; ``numbers``: (n,) int64, each box's number in its
        column, from below.

    Raises:
        ValueError: the load is not of the paper's substacks.
    """
    kinds = np.zeros((len(np.unique(load.walls)), len(COLUMNS)), np.int64)
    columns, numbers = np.empty((2, len(load)), np.int64)
    if not _find_columns(load.packages, FIRST, COUNTS, kinds, columns, numbers):
        raise ValueError(f"load is {load}; expected a load of the paper's substacks")
    return kinds, columns, numbers


@compiled
def _find_columns(packages, first, counts, kinds, columns, numbers):
    """Fill what ``columns_of`` returns; whether the load is of substacks."""
    walls, across = kinds.shape
    heights = np.zeros((walls, across), np.int64)  # boxes so far in each column
    box = 0
    for wall in range(walls):
        for _ in range(ROWS):
            for column in range(across):
                variant = 0
                while variant < 3 and (
                    box >= len(packages) or packages[box] != first[column, variant]
                ):
                    variant += 1
                if variant == 3 or box + counts[column, variant] > len(packages):
                    return False
                kinds[wall, column] = 3 * kinds[wall, column] + variant
                for _ in range(counts[column, variant]):
                    columns[box] = wall * across + column
                    numbers[box] = heights[wall, column]
                    heights[wall, column] += 1
                    box += 1
    return box == len(packages)
