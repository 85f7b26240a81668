"""Random loads for tests of properties."""

import numpy as np
from hypothesis import strategies as st

from unload import task
from unload.load.boxes import Load


@st.composite
def cut(draw, axis: int, most: int) -> np.ndarray:
    """Up to ``most`` neighbouring intervals of a container's axis; their ends in m."""
    places = st.lists(st.integers(0, 500), min_size=2, max_size=most + 1, unique=True)
    return np.sort(draw(places)) * (task.CONTAINER[axis] / 500)


@st.composite
def corners(draw) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corners of disjoint boxes, (n, 3) in m.

    Walls one behind the other, of columns side by side, of boxes one upon the other, some of
    which bridge two columns. Each fills its cell of the grid, or leaves a gap.
    """
    low, high = [], []
    xs = draw(cut(axis=0, most=2))
    for x0, x1 in zip(xs, xs[1:]):
        ys = draw(cut(axis=1, most=4))
        for y0, y1 in zip(ys, ys[1:]):
            z = 0.0
            for height in draw(st.lists(st.integers(1, 160), max_size=3)):
                gap = draw(st.sampled_from([0.0, 0.0, 0.002])) if y1 - y0 > 0.01 else 0.0
                low.append((x0, y0 + gap, z))
                z += height / 200
                high.append((x1, y1, z))
    if not low:
        low, high = [(1.0, 1.0, 0.0)], [(2.0, 2.0, 1.0)]
    bridged = np.array(high)[:, 2].max()
    if bridged < 2.4 and draw(st.booleans()):
        low.append((0.0, draw(st.integers(0, 100)) / 100, bridged))
        high.append((7.0, draw(st.integers(150, 250)) / 100, bridged + 0.1))
    return np.array(low), np.array(high)


def load_of(low: np.ndarray, high: np.ndarray) -> Load:
    """The load with boxes of these corners."""
    labels = np.zeros(len(low), dtype=int)
    return Load((low + high) / 2, high - low, labels, labels)


def loads() -> st.SearchStrategy[Load]:
    return corners().map(lambda pair: load_of(*pair))
