"""The values of blocked items before a fall and after it."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from unload.reproduce.figures.style import styled
from unload.reproduce.values import TRACED, read_values
from unload.support import checks, files


@styled
def value_traces(changes: Mapping[str, str], folder: str | Path = files.DATA) -> Figure:
    """MSR while training, and mean value of blocked items: a line for each run, by change.

    The values are those of the items in the containers of the first episode after the change.

    Args:
        changes: names in ``unload.reproduce.values.TRACED`` → text.
        folder: of the data.

    Raises:
        ValueError: no changes, or an unknown one.
        FileNotFoundError: the data have not been made.
    """
    for change in changes:
        checks.one_of("changes", change, TRACED)
    if not changes:
        raise ValueError("changes is empty; expected at least one")
    table = read_values(folder)
    figure, grid = plt.subplots(
        2, len(changes), figsize=(0.6 + 1.75 * len(changes), 3.6), sharex=True, sharey="row",
        squeeze=False,
    )  # fmt: skip
    for (upper, lower), (change, text) in zip(grid.T, changes.items()):
        for number, (_, run) in enumerate(table[table["change"] == change].groupby("seed")):
            for axes, name in ((upper, "success_rate"), (lower, "blocked")):
                axes.plot(run["picks"] / 1e6, run[name], color=f"C{number}", linewidth=1)
        upper.set_title(text, fontsize=9)
    grid[0, 0].set(ylim=(0, 1.02), ylabel="MSR while\ntraining")
    grid[0, 0].yaxis.set_major_formatter(PercentFormatter(1))
    grid[1, 0].set(ylim=(-1.05, 1.05), ylabel="mean value of\nblocked items")
    figure.supxlabel("million picks", fontsize=9)
    return figure
