"""Many containers side by side (Fig. 2)."""

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from unload.reproduce.figures.style import styled
from unload.support import checks


@styled
def fig02_containers(
    images: Sequence[np.ndarray], unloaded: Sequence[int] | None = None, columns: int = 8
) -> Figure:
    """Fig. 2: pictures of the containers of a vector environment in a grid.

    Args:
        images: of equal shape (height, width, 3) uint8, as ``render`` of a vector
            environment returns them, in the order in which they are drawn.
        unloaded: items unloaded from each container, written below its picture.
        columns: pictures in a line.

    Raises:
        ValueError: there is no picture, they differ in shape, or ``unloaded`` has
            another length.
    """
    checks.integer("columns", columns, 1)
    shapes = {np.shape(image) for image in images}
    if len(shapes) != 1 or len(next(iter(shapes))) != 3:
        raise ValueError(
            f"images has shapes {sorted(shapes)}; expected one, (height, width, 3), for all"
        )
    if unloaded is not None and len(unloaded) != len(images):
        raise ValueError(f"unloaded has {len(unloaded)} entries; expected {len(images)}")
    images = _crop(np.stack(images))
    lines = -(-len(images) // columns)
    _, height, width, _ = images.shape
    cell = 8 / columns  # inches
    figure, grid = plt.subplots(
        lines,
        columns,
        figsize=(8, lines * (cell * height / width + (0.0 if unloaded is None else 0.12))),
        squeeze=False,
    )
    for axes in grid.flat:
        axes.axis("off")
    for number, (axes, image) in enumerate(zip(grid.flat, images)):
        axes.imshow(image, interpolation="antialiased")
        if unloaded is not None:
            axes.text(0.5, 0.0, unloaded[number], transform=axes.transAxes, ha="center",
                      va="top", fontsize=6, color="#555555")  # fmt: skip
    return figure


def _crop(images: np.ndarray) -> np.ndarray:
    """Cut away the margin that is white in all pictures."""
    drawn = (images < 255).any(axis=(0, 3))
    rows, columns = np.flatnonzero(drawn.any(axis=1)), np.flatnonzero(drawn.any(axis=0))
    if not len(rows):
        return images
    return images[:, rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
