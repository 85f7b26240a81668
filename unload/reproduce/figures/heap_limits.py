"""What limits a learned policy on heaps."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from unload.reproduce.figures.style import mark_reduced, styled
from unload.reproduce.heap import NAME
from unload.reproduce.heap_learning import LEARNED
from unload.reproduce.results import COMMAND, read_table
from unload.support import files


def repeatability(disturbed: pd.DataFrame) -> pd.Series:
    """Correlation of boxes - falls with those of the same pick undisturbed, by distance (m).

    Args:
        disturbed: see ``unload.reproduce.heap_limits.limits_data``.
    """
    net = (disturbed["boxes"] - disturbed["falls"]).to_numpy()
    by = disturbed.assign(net=net).pivot(index="pick", columns="distance", values="net")
    return by.drop(columns=0.0).corrwith(by[0.0])


@styled
def limits(folder: str | Path = files.DATA) -> Figure:
    """How well picks are foretold, by the heaps learned from, and bounds.

    A bound is the square root of ``repeatability``: if two outcomes of one heap, up to so small
    a distance, correlate by ρ, their mean over many repetitions, which is the best forecast,
    correlates with each of them by √ρ.

    Args:
        folder: of ``heap/limits.csv`` and ``heap/disturbed.csv``.

    Raises:
        FileNotFoundError: a table is missing; the message names the command.
    """
    place, command = Path(folder) / NAME, f"{COMMAND} heap-limits"
    columns = ["variant", "heaps", "seed", "correlation"]
    table = read_table(place / "limits.csv", command, columns)
    learned = table[table["variant"] == LEARNED]
    picks = read_table(place / "disturbed.csv", command, ["pick", "distance", "boxes", "falls"])
    figure, axes = plt.subplots(figsize=(6, 3.6))
    axes.plot(learned["heaps"], learned["correlation"], "o", ms=5, label="learned, one network")
    means = learned.groupby("heaps")["correlation"].mean()
    axes.plot(means.index, means, lw=1.6, color="C0")
    for name, of in table[table["variant"] != LEARNED].groupby("variant", sort=False):
        mean, most = of["correlation"].mean(), of["heaps"].max()
        axes.plot(of["heaps"], of["correlation"], "o", color="0.6", ms=3)
        axes.annotate(
            name, (most, mean), xytext=(6, 0), textcoords="offset points", va="center", fontsize=8
        )
    for number, (distance, value) in enumerate(repeatability(picks).items()):
        label = f"bound if boxes are known to {1000 * distance:g} mm"
        axes.axhline(value**0.5, color="0.3", ls=("--", ":")[number % 2], label=label)
    axes.set(
        xscale="log",
        xticks=list(means.index),
        xticklabels=list(means.index),
        xlabel="heaps learned from",
        ylabel="correlation of boxes − falls",
        ylim=(np.floor(10 * table["correlation"].min()) / 10, 1),
        xlim=(means.index.min() / 1.2, means.index.max() * 1.8),
    )
    axes.minorticks_off()
    axes.legend(fontsize=8, loc="lower left")
    mark_reduced(figure, place, "limits")
    return figure
