"""Learning curves: of many runs over steps (Figs. 8–10), or of one over picks."""

from collections.abc import Collection, Mapping

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

from studies.paper.training import episode_means
from studies.paper.tuning import running_mean
from studies.style import COLOURS, styled
from unload import task

Curves = dict[int, np.ndarray]  # one value per training step, by the number of the run
FE_COLOURS = {"with FE": COLOURS["ranks"], "without FE": COLOURS["positions"]}


@styled
def over_steps(curves: Mapping[str, tuple[Curves, int]], label: str) -> Figure:
    """Running means over 25 steps of all runs, one of each configuration as a strong line.

    Args:
        curves: by name: the curves of all runs, and the number of the strong one, which stands
            in the legend if there are others.
        label: of the vertical axis, an MSR unless it says "loss".
    """
    figure, axes = plt.subplots()
    for (name, (runs, shown)), colour in zip(curves.items(), colours_of(curves)):
        draw_runs(axes, name, runs, shown, colour)
    steps = max(len(values) for runs, _ in curves.values() for values in runs.values())
    axes.set(xlabel="step $k$", ylabel=label, xlim=(0, steps))
    axes.set(ylim=(0, 0.6) if "loss" in label else (0, 1.02))
    others = any(len(runs) > 1 for runs, _ in curves.values())
    note = "thin: the other runs of the same configuration" if others else None
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=2, title=note, title_fontsize=8)
    return figure


def draw_runs(axes: Axes, name: str, runs: Curves, shown: int, colour) -> None:
    """Draw the runs of a configuration, one of them as a strong line; see ``over_steps``."""
    for run, values in runs.items():
        smooth = running_mean(values)
        if run == shown:
            label_of_run = f"{name}, run {shown}" if len(runs) > 1 else name
            axes.plot(smooth, color=colour, label=label_of_run, zorder=3)
        else:
            axes.plot(smooth, color=colour, linewidth=0.5, alpha=0.4)


def colours_of(names: Collection[str]) -> list:
    """A colour a name: of what an agent sees, else from a scale for the values of a setting."""
    scale = plt.get_cmap("viridis")(np.linspace(0, 0.85, len(names)))
    return [FE_COLOURS.get(name, colour) for name, colour in zip(names, scale)]


def draw_learning_curve(
    axes: Axes, curve: pd.DataFrame, name: str, color: str = COLOURS["ranks"]
) -> None:
    """Draw the MSR while training: pale at each point of the curve, strong over whole episodes.

    Args:
        axes: where.
        curve: of ``unload.train``, see ``episode_means``.
        name: in the legend.
        color: of both lines.
    """
    axes.plot(curve["picks"], curve["success_rate"], color=color, linewidth=0.7, alpha=0.45)
    episodes = episode_means(curve)
    middle = episodes["picks"] - task.NUM_ENVS * task.MAX_PICKS / 2
    axes.plot(middle, episodes["success_rate"], "o-", color=color, markersize=3.5, label=name)
    axes.set(xlabel="picks", ylabel="MSR while training", ylim=(0, 1.02), xlim=(0, None))
    axes.xaxis.set_major_formatter(EngFormatter(sep=" "))
