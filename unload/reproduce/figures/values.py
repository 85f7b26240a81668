"""What networks think of items, and where they are wrong, before a fall and after it."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from unload.reproduce.figures.style import hide_unused, styled
from unload.reproduce.interventions import SEEDS
from unload.reproduce.values import FRESH, FRESHER, TRACED, read_values
from unload.support import checks, files


@styled
def value_traces(changes: Mapping[str, str], folder: str | Path = files.DATA) -> Figure:
    """MSR while training, and mean value of blocked items: a line for each run, by change.

    The runs are those in which every change was made. The values are those of the items in the
    kept states, which are those of the first episode after the change.

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
    table = table[table["seed"].isin(SEEDS)]
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
    figure.supxlabel("picks (millions)", fontsize=9)
    return figure


@styled
def wrong_states(folder: str | Path = files.DATA) -> Figure:
    """Share of states in which a blocked item has the highest value: a panel for each fresh run.

    Of the run's network on the states of each episode and on the kept ones, which are those of the
    first episode, and of the network of before on the states of each episode.

    Args:
        folder: of the data.

    Raises:
        FileNotFoundError: the data have not been made.
    """
    lines = {
        "own_wrong": "the run's network in the states that it comes into",
        "start_wrong": "the network of 12 million picks in the same states",
        "wrong": "the run's network in the states of 12 million picks",
    }
    table = read_values(folder)
    fresh = table["seed"].isin([*FRESH, *FRESHER])
    runs = table[(table["change"] == "nothing") & fresh].groupby("seed")
    rows = -(-len(runs) // 4)
    figure, grid = plt.subplots(
        rows, 4, figsize=(7.8, 0.9 + 1.3 * rows), sharex=True, sharey=True, squeeze=False
    )
    for axes, (seed, run) in zip(grid.flat, runs):
        for name, text in lines.items():
            axes.plot(run["picks"] / 1e6, run[name], linewidth=1, label=text)
        axes.set_title(f"seed {seed}", fontsize=9)
    hide_unused(grid, len(runs))
    axes = grid[0, 0]
    axes.set_ylim(0, 1)
    axes.yaxis.set_major_formatter(PercentFormatter(1))
    handles = axes.get_legend_handles_labels()
    figure.legend(*handles, loc="outside upper center", fontsize=8)
    figure.supxlabel("picks (millions)", fontsize=9)
    figure.supylabel("a blocked item has the highest value", fontsize=9)
    return figure
