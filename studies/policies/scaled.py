"""Loads whose boxes have another scale than the paper's, in the same container."""

import numpy as np

from unload import task
from unload.load.boxes import Load
from unload.load.substacks import CELL, CELLS_HIGH, COLUMNS, LEFT, MID, PACKAGES, RIGHT

# By scale, how many walls keep the boxes' proportions, and how many rows and columns of substacks
# fit: boxes × 0.8 leave a gap of 0.5 m at a side wall, boxes × 1.2 one of 0.33 m.
FITTING = {0.8: (15, 4, 4), 1.2: (10, 3, 3)}


def scaled_load(scale: float, rng: np.random.Generator) -> Load:
    """Draw a load as ``unload.stack_load`` does, with a variant for each substack of each wall.

    Args:
        scale: of the boxes' widths and heights, one of ``FITTING``.
        rng: the source of randomness.
    """
    walls, rows, columns = FITTING[scale]
    edges, substacks = [left for left, _ in COLUMNS], (LEFT, *[MID] * (columns - 2), RIGHT)
    variants = rng.integers(3, size=(walls, rows, columns))
    boxes = np.array(
        [
            (package, wall, edges[column] + left, CELLS_HIGH * row + low)
            for (wall, row, column), variant in np.ndenumerate(variants)
            for package, left, low in substacks[column][variant]
        ]
    )
    packages, corners = boxes[:, 0], boxes[:, 1:]
    sizes = np.insert(PACKAGES, 0, 1, axis=1)[packages]  # in walls and cells, as the corners
    units = np.array([task.CONTAINER[0] / walls, CELL * scale, CELL * scale])
    return Load((corners + sizes / 2) * units, sizes * units, packages, corners[:, 0])
