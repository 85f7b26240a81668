"""What the agent sees, before and after equalization (Figs. 4–6): the positions and the figures.

python -m studies observation
"""

from pathlib import Path

import gymnasium
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies import paths
from studies.paper.loads import draw_items
from studies.results import COMMAND, measured, publish, read_table
from studies.style import COLOURS as SEEN_COLOURS
from studies.style import styled
from unload import task
from unload.env import observation
from unload.env.equalization import equalize
from unload.load.picture import COLOURS

FOLDER = "obs_hist_equal"  # of the paper's own plots
SEED = 0  # of the load
# Of ranks instead of positions; all other colours mean what they mean in every picture.
EQUALIZED = SEEN_COLOURS["ranks"]
# Fig. 5: the paper's histogram. The edges lie just outside [-1, 1].
BINS = np.linspace(-1.001, 1.001, 111)


def observation_data(folder: str | Path = paths.DATA) -> None:
    """Write ``obs_hist_equal/{all_items,Observation,Equalized_Observation}.csv``.

    Columns ``x`` and ``y``: scaled x and z of all items, of the 128 observed ones, and of the
    observed ones after equalization.
    """
    result = measured(_positions)
    tables = {
        name: pd.DataFrame(positions[:, [0, 2]], columns=["x", "y"])
        for name, positions in result.value.items()
    }
    place, command = Path(folder) / FOLDER, f"{COMMAND} observation"
    settings = {"seed": SEED}
    publish(place, "observation", tables, command, settings, [result], float_format="%.6f")


def _positions() -> dict[str, np.ndarray]:
    """Scaled positions, (items, 3), by the name of the file."""
    env = gymnasium.make("unload/Container-v0").unwrapped
    observed, _ = env.reset(seed=SEED)
    everything = observation.scale(env.observed_positions())
    env.close()
    return {
        "all_items": everything,
        "Observation": observed,
        "Equalized_Observation": equalize(observed),
    }


def read_points(name: str, folder: str | Path = paths.DATA) -> np.ndarray:
    """Points of one of the paper's scatter plots.

    Args:
        name: ``"all_items"``, ``"Observation"`` or ``"Equalized_Observation"``.
        folder: holds ``obs_hist_equal/name.csv``, columns ``x`` and ``y``.

    Returns:
        (n, 2) float64, x and z of each item, scaled to [-1, 1].

    Raises:
        FileNotFoundError: the file is missing; the message names the command that makes it.
        ValueError: the file has other columns.
    """
    path = Path(folder) / FOLDER / f"{name}.csv"
    return read_table(path, f"{COMMAND} observation", ["x", "y"])[["x", "y"]].to_numpy()


@styled
def fig04_observation(folder: str | Path = paths.DATA) -> Figure:
    """Fig. 4: side view of all items of a fresh container, and of the observed ones."""
    groups = {
        "all items": (read_points("all_items", folder), COLOURS["unseen"]),
        "visible items": (read_points("Observation", folder), COLOURS["visible"]),
    }
    return _side_view(groups, r"\tilde{p}")


@styled
def fig05_histogram(folder: str | Path = paths.DATA) -> Figure:
    """Fig. 5: histogram of the visible items' x, before and after equalization."""
    figure, axes = plt.subplots(figsize=(4.6, 4.8))
    for name, colour, label in (
        ("Observation", COLOURS["visible"], "visible items"),
        ("Equalized_Observation", EQUALIZED, "equalized observation"),
    ):
        x = read_points(name, folder)[:, 0]
        look = {"color": colour, "alpha": 0.75, "edgecolor": colour, "linewidth": 0.6}
        axes.hist(x, bins=BINS, label=label, **look)
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
def fig06_equalized(folder: str | Path = paths.DATA) -> Figure:
    """Fig. 6: side view of the visible items after equalization."""
    points = read_points("Equalized_Observation", folder)
    return _side_view({"equalized observation": (points, EQUALIZED)}, r"\tilde{p}'")


def _side_view(groups: dict[str, tuple[np.ndarray, tuple]], position: str) -> Figure:
    """Points and their colour by what they are called."""
    figure, axes = plt.subplots(figsize=(4.6, 4.8))
    for label, (points, colour) in groups.items():
        axes.plot(*points.T, "o", ms=4.5, mew=0.3, mec="0.55", color=colour, label=label)
    ticks = np.arange(-1, 1.1, 0.5)
    axes.set(xlim=(-1.1, 1.1), ylim=(-1.1, 1.1), xticks=ticks, yticks=ticks, aspect="equal")
    axes.set_xlabel(rf"${position}_{{0,i,\mathrm{{x}}}}$")
    axes.set_ylabel(rf"${position}_{{0,i,\mathrm{{z}}}}$")
    _legend_above(axes)
    return figure


@styled
def visibility(positions: np.ndarray, visible: np.ndarray) -> Figure:
    """Side view of all items, of the visible ones, and of lines of equal distance d.

    The thick line goes through the farthest visible item.

    Args:
        positions: (n, 3) float, centres in m.
        visible: (k,) int, the visible items.
    """
    length, _, height = task.CONTAINER
    x, z = np.meshgrid(np.linspace(0, length, 200), np.linspace(0, height, 100))
    points = np.stack([x, 0 * x, z], axis=-1).reshape(-1, 3)
    d = observation.distance(points).reshape(x.shape)
    figure, axes = plt.subplots(figsize=(8, 3.6))
    lines = axes.contour(x, z, d, levels=np.arange(1, 8), colors="#999999", linewidths=0.7)
    axes.clabel(lines, fmt="d = %g m", fontsize=8)
    farthest = observation.distance(positions[visible]).max()
    axes.contour(x, z, d, levels=[farthest], colors="black", linewidths=1.8)
    unseen = np.setdiff1d(np.arange(len(positions)), visible)
    draw_items(axes, positions[:, [0, 2]], {"unseen": unseen, "visible": visible})
    axes.plot(*task.VIEWPOINT[[0, 2]], "k^", ms=9, clip_on=False, ls="none", label="viewpoint")
    axes.set(xlim=(0, length), ylim=(0, height), xlabel="x (m), entrance on the right")
    axes.set(ylabel="z (m)", aspect="equal")
    axes.grid(False)
    _legend_above(axes)
    return figure


def _legend_above(axes: Axes) -> None:
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=3, borderaxespad=0.4)
