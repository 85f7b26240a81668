"""Whose picks does a training learn from? With a constant share of random ones."""

from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from unload.reproduce.figures.style import styled
from unload.reproduce.intervals import bootstrap_interval, with_intervals
from unload.reproduce.random_share import HALF, NOISY, read_random_share
from unload.support import files

MAKERS = {1.0: "random picks", 0.5: "half the agent's own picks"}  # by the share of random picks


@styled
def own_picks(folder: str | Path = files.DATA) -> Figure:
    """MSR without the mask after 96,000 picks: by the share of own picks, and by the features.

    Left are the paper's features, the noisy ranks; right all features with half of the picks
    the agent's own. A dot is a training; beside them stands their mean with its 95 % bootstrap
    interval.

    Args:
        folder: of the data.

    Raises:
        FileNotFoundError, ValueError: see ``read_random_share``.
    """
    trials, _ = read_random_share(folder)
    trials = trials[~trials["mask"] & (trials["remember"] == "all")]
    shares = dict(list(trials[trials["features"] == NOISY].groupby("epsilon", sort=False)))
    groups = (
        {f"{1 - epsilon:.0%}": group for epsilon, group in shares.items()},
        dict(list(trials[trials["epsilon"] == HALF["epsilon"]].groupby("features", sort=False))),
    )
    figure, panels = plt.subplots(1, 2, figsize=(8.4, 2.9), sharey=True, width_ratios=(1, 1.6))
    for axes, cells in zip(panels, groups):
        for place, cell in enumerate(cells.values()):
            msr = cell["msr_no_mask"].to_numpy()
            colour = "C1" if "noisy" in cell["features"].iloc[0] else "C0"
            axes.plot([place - 0.1] * len(msr), msr, "o", color=colour, alpha=0.4, markersize=4)
            axes.plot([place + 0.15] * 2, bootstrap_interval(msr), color=colour, linewidth=1.2)
            axes.plot(place + 0.15, msr.mean(), "_", color=colour, markersize=9)
        names = [name.replace(" of", "\nof").replace(" ", "\n", 1) for name in cells]
        axes.set_xticks(range(len(names)), names, fontsize=8)
        axes.set(xlim=(-0.5, len(names) - 0.5), ylim=(0, 1.03))
    left, right = panels
    left.set(xlabel="share of the agent's own picks", ylabel="MSR, without the mask", title=NOISY)
    left.yaxis.set_major_formatter(PercentFormatter(1))
    right.set_title("half of the picks the agent's own")
    return figure


@styled
def success_by_height(folder: str | Path = files.DATA, ranks: int = 24) -> Figure:
    """Share of random picks that succeed, by the noisy rank of the height.

    The bands are 95 % bootstrap intervals over the trainings.

    Args:
        folder: of the data.
        ranks: how many from the top.

    Raises:
        FileNotFoundError, ValueError: see ``read_random_share``.
    """
    _, heights = read_random_share(folder)
    heights = heights[heights["rank"] <= ranks]
    heights = heights.assign(share=heights["succeeded"] / heights["tried"])
    figure, axes = plt.subplots(figsize=(5, 2.8))
    for number, (epsilon, makers) in enumerate(MAKERS.items()):
        points = with_intervals(heights[heights["epsilon"] == epsilon], ["rank"], ["share"])
        line, colour = "os"[number] + "-", f"C{number}"
        axes.plot(points["rank"], points["share"], line, color=colour, markersize=3, label=makers)
        axes.fill_between(points["rank"], points["share_low"], points["share_high"],
                          color=colour, alpha=0.2, linewidth=0)  # fmt: skip
    axes.set(xlabel="rank of the height, from the top", ylabel="share that succeeds")
    axes.set_ylim(0, 1.03)
    axes.yaxis.set_major_formatter(PercentFormatter(1))
    axes.legend(title="containers made by", loc="lower left")
    return figure
