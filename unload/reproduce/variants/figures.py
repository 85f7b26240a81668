"""What other networks, rewards and settings come to."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from unload.reproduce.grid import read_measures
from unload.reproduce.statistics import bootstrap_interval
from unload.reproduce.style import styled
from unload.reproduce.variants.grids import GRIDS
from unload.support import checks, files

APPLIED = {"msr_mask": ("C0", "o", "with the mask"), "msr_no_mask": ("C1", "s", "without the mask")}


@styled
def variants_msr(grid: str, folder: str | Path = files.DATA) -> Figure:
    """MSR of the policies of a grid: each seed pale, their mean strong, with its 95 % interval.

    Args:
        grid: a name in ``unload.reproduce.variants.grids.GRIDS``.
        folder: of the data.

    Raises:
        ValueError: an unknown grid.
        FileNotFoundError: it has not been published.
    """
    checks.one_of("grid", grid, GRIDS)
    rows = read_measures(GRIDS[grid], folder)
    cells = dict(list(rows.groupby("cell", sort=False)))
    figure, axes = plt.subplots(figsize=(6.4, 0.8 + 0.34 * len(cells)))
    for row, cell in enumerate(cells.values()):
        for place, (name, (colour, marker, label)) in enumerate(APPLIED.items()):
            y = row + (0.15 if place else -0.15)
            style = {"color": colour, "marker": marker, "linestyle": "none"}
            axes.plot(cell[name], np.full(len(cell), y), **style, alpha=0.3, markersize=3)
            low, high = bootstrap_interval(cell[name].to_numpy())
            axes.plot([low, high], [y, y], color=colour, linewidth=1.2)
            label = None if row else label
            axes.plot(cell[name].mean(), y, **style, markersize=6, label=label)
    axes.set_yticks(range(len(cells)), [name.replace("_", " ") for name in cells])
    axes.set_ylim(len(cells) - 0.5, -0.5)
    axes.set(xlabel="MSR of the trained policy on fresh loads", xlim=(0, 1.02))
    axes.xaxis.set_major_formatter(PercentFormatter(1))
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=2)
    return figure
