"""What agents are worth by the picks that they learn from."""

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from studies.style import COLOURS, WITHOUT_MASK, styled


@styled
def by_what_is_learned(runs: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """MSR in new containers, and how much height counts, by the picks that are learned from.

    Args:
        runs: ``mask/laboratory``; a dot per run, a bar at the mean.
        names: cell → what it is called; drawn from top to bottom.
    """
    size = (8.4, 0.36 * len(names) + 1)
    figure, panels = plt.subplots(1, 2, figsize=size, sharey=True, width_ratios=(1.5, 1))
    rng = np.random.default_rng(0)  # dots of a line are spread a little, to be told apart
    for line, cell in enumerate(names):
        rows = runs[runs["cell"] == cell]
        colour = WITHOUT_MASK if cell.endswith("_no_mask") else COLOURS["ranks"]
        for axes, values in zip(panels, (100 * rows["msr"], rows["slope_z"])):
            heights = line + rng.uniform(-0.2, 0.2, len(rows))
            axes.plot(values, heights, ".", color=colour, ms=5, alpha=0.6, clip_on=False)
            axes.plot(values.mean(), line, "k|", ms=14, mew=2)
    left, right = panels
    left.set(xlim=(0, 100), ylim=(len(names) - 0.4, -0.6))
    left.set_xlabel("MSR in new containers, with the mask (%)")
    right.set_xlabel("slope of the score with height")
    left.set_yticks(range(len(names)), names.values())
    for axes in panels:
        axes.grid(axis="y", visible=False)
    return figure
