"""Four cubes, and what a pick has done to them."""

import numpy as np
import pytest

from studies.heap.boxes import Heap
from studies.heap.rake import Outcome


@pytest.fixture
def heap(cubes) -> Heap:
    """Three upright cubes of 0.4 m, and one that is turned by 45° about the vertical."""
    upright = cubes((5, 1, 0), (5, 1, 1), (6, 2, 0), (6, 1, 0))
    turns = upright.orientations.copy()
    turns[3] = (0, 0, np.sin(np.pi / 8), np.cos(np.pi / 8))
    return Heap(upright.positions, turns, upright.sizes, upright.packages)


@pytest.fixture
def outcome(heap) -> Outcome:
    """Box 0 was dragged and box 2 came with it; box 1 fell."""
    left = np.array([1, 3])
    after = heap.only(left)
    places = after.positions - [[0, 0, 0.4], [0, 0, 0]]
    after = Heap(places, after.orientations, after.sizes, after.packages)
    unloaded, fallen = np.array([1, 0, 1, 0], bool), np.array([0, 1, 0, 0], bool)
    return Outcome(after, left, unloaded, fallen, 0.7, True)
