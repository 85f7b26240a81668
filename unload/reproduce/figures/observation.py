"""What the agent sees, before and after equalization (Figs. 4–6)."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from unload.reproduce.figures.style import styled
from unload.reproduce.results import read_table
from unload.support import files

FOLDER = "obs_hist_equal"
# The paper's colours, in this repository's shades.
ALL, OBSERVED, EQUALIZED = "#2878b5", "#de5638", "#45a661"
# Fig. 5: the paper's histogram. The edges lie just outside [-1, 1].
BINS = np.linspace(-1.001, 1.001, 111)


def read_points(name: str, folder: str | Path = files.DATA) -> np.ndarray:
    """Points of one of the paper's scatter plots.

    Args:
        name: ``"all_items"``, ``"Observation"`` or ``"Equalized_Observation"``.
        folder: holds ``obs_hist_equal/name.csv``, columns ``x`` and ``y``.

    Returns:
        (n, 2) float64, x and z of each item, scaled to [-1, 1].

    Raises:
        FileNotFoundError: the file is missing; the message names the command that makes it.
        ValueError: the file has other columns, no rows, or values that are not finite.
    """
    path = Path(folder) / FOLDER / f"{name}.csv"
    table = read_table(path, "python -m unload.reproduce observation", ["x", "y"], exact=True)
    return table.to_numpy(dtype=np.float64)


@styled
def fig04_observation(folder: str | Path = files.DATA) -> Figure:
    """Fig. 4: side view of all items of a fresh container, and of the observed ones.

    Args:
        folder: holds ``obs_hist_equal/{all_items,Observation}.csv``.

    Raises:
        FileNotFoundError, ValueError: see ``read_points``.
    """
    everything, observed = read_points("all_items", folder), read_points("Observation", folder)
    figure, axes = plt.subplots(figsize=(4.6, 4.8))
    axes.plot(*everything.T, "o", ms=4, mew=0, color=ALL, label="all items")
    axes.plot(*observed.T, "o", ms=4, mew=0, color=OBSERVED, label="observed items")
    _side_view(axes, r"$\tilde{p}_{0,i,\mathrm{x}}$", r"$\tilde{p}_{0,i,\mathrm{z}}$")
    _legend_above(axes)
    return figure


@styled
def fig05_histogram(folder: str | Path = files.DATA) -> Figure:
    """Fig. 5: histogram of the observed items' x, before and after equalization.

    Args:
        folder: holds ``obs_hist_equal/{Observation,Equalized_Observation}.csv``.

    Raises:
        FileNotFoundError, ValueError: see ``read_points``.
    """
    figure, axes = plt.subplots(figsize=(4.6, 4.8))
    for name, colour, label in (
        ("Observation", OBSERVED, "observed items"),
        ("Equalized_Observation", EQUALIZED, "equalized observation"),
    ):
        axes.hist(
            read_points(name, folder)[:, 0],
            bins=BINS,
            color=colour,
            alpha=0.75,
            edgecolor=colour,
            linewidth=0.6,
            label=label,
        )
    axes.set(
        xlim=(-1.1, 1.1),
        xticks=np.arange(-1, 1.1, 0.5),
        xlabel=r"$\tilde{p}_{0,i,\mathrm{x}}\,,\ \tilde{p}'_{0,i,\mathrm{x}}$",
        ylim=(0, max(70, axes.get_ylim()[1])),
        ylabel="number of items $n$",
    )
    _legend_above(axes)
    return figure


@styled
def fig06_equalized(folder: str | Path = files.DATA) -> Figure:
    """Fig. 6: side view of the observed items after equalization.

    Args:
        folder: holds ``obs_hist_equal/Equalized_Observation.csv``.

    Raises:
        FileNotFoundError, ValueError: see ``read_points``.
    """
    figure, axes = plt.subplots(figsize=(4.6, 4.6))
    axes.plot(*read_points("Equalized_Observation", folder).T, "o", ms=4, mew=0, color=EQUALIZED)
    _side_view(axes, r"$\tilde{p}'_{0,i,\mathrm{x}}$", r"$\tilde{p}'_{0,i,\mathrm{z}}$")
    return figure


def _side_view(axes: Axes, xlabel: str, ylabel: str) -> None:
    ticks = np.arange(-1, 1.1, 0.5)
    axes.set(
        xlim=(-1.1, 1.1),
        ylim=(-1.1, 1.1),
        xticks=ticks,
        yticks=ticks,
        xlabel=xlabel,
        ylabel=ylabel,
        aspect="equal",
    )


def _legend_above(axes: Axes) -> None:
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=2, borderaxespad=0.2)
