"""The learning curves of Figs. 8–12, and what the notebooks draw of runs and policies."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

from studies import paths
from studies.paper.training import PAPER, default_curves, episode_means
from studies.paper.tuning import REACHED, greedy_msr, read_curves, running_mean
from studies.style import COLOURS, mark_reduced, styled
from unload import task
from unload.load.picture import COLOURS as BOX_COLOURS

Curves = dict[int, np.ndarray]  # one value per training step, by the number of the run
SEED_COLOURS = ("black", "#e69f00", "#56b4e9", "#cc79a7")  # distinct for the colour-blind, too
FE_COLOURS = {"with FE": COLOURS["ranks"], "without FE": COLOURS["positions"]}


@styled
def fig08_learning_rate(folder: str | Path = paths.DATA) -> Figure:
    """MSR while training over steps for three learning rates, batch size 1024 (Fig. 8).

    The strong lines are the runs that the paper shows; the thin ones are all others.

    Args:
        folder: of the curves that ``python -m studies tuning`` writes.

    Raises:
        FileNotFoundError: there are none.
    """
    curves = {
        rf"$\mu = 10^{{-{power}}}$": (
            read_curves("success_rate", 1024, 10.0**-power, folder=folder), shown
        )
        for power, shown in ((1, 6), (2, 7), (3, 5))
    }  # fmt: skip
    return _over_steps(curves, "MSR while training")


@styled
def fig09_batch_size(folder: str | Path = paths.DATA) -> Figure:
    """MSR while training over steps for four batch sizes, learning rate 10⁻³ (Fig. 9).

    Arguments, lines and errors as in ``fig08_learning_rate``.
    """
    curves = {
        f"$b = {batch_size}$": (read_curves("success_rate", batch_size, 1e-3, folder=folder), shown)
        for batch_size, shown in ((64, 9), (256, 9), (1024, 5), (2048, 6))
    }
    return _over_steps(curves, "MSR while training")


@styled
def fig10_loss(folder: str | Path = paths.DATA) -> Figure:
    """Loss over training steps with and without feature engineering, b = 2048 (Fig. 10).

    Arguments, lines and errors as in ``fig08_learning_rate``.
    """
    curves = {
        "with FE": (read_curves("loss", 2048, 1e-3, True, folder), 6),
        "without FE": (read_curves("loss", 2048, 1e-3, False, folder), 8),
    }
    return _over_steps(curves, r"loss $\ell$")


@styled
def greedy_curves(folder: str | Path = paths.DATA) -> Figure:
    """Greedy MSR by learning rate, batch size and feature engineering: the runs of Figs. 8–10.

    Each line is the mean over all runs of a configuration, its band one standard error.

    Arguments and errors as in ``fig08_learning_rate``.
    """
    panels = {
        "with FE, b = 1024": {f"μ = {rate:g}": (1024, rate, True) for rate in (1e-1, 1e-2, 1e-3)},
        "with FE, μ = 0.001": {f"b = {size}": (size, 1e-3, True) for size in (64, 256, 1024, 2048)},
        "μ = 0.001, b = 2048": {
            "with FE": (2048, 1e-3, True),
            "without FE": (2048, 1e-3, False),
        },
    }
    figure, all_axes = plt.subplots(1, 3, figsize=(9.6, 3.2), sharey=True)
    for axes, (title, cells), end in zip(all_axes, panels.items(), (3000, 600, 600)):
        curves = {
            name: read_curves("success_rate", *cell, folder=folder) for name, cell in cells.items()
        }
        draw_greedy(axes, curves)
        axes.set(title=title, xlim=(0, end))
    all_axes[0].set_ylabel("greedy MSR")
    return figure


@styled
def draw_greedy(axes: Axes, curves: Mapping[str, Curves]) -> None:
    """Draw the mean greedy MSR of each configuration's runs, with a band of one standard error.

    Args:
        axes: where.
        curves: MSR while training of all runs, by the configuration's name.
    """
    for (name, runs), colour in zip(curves.items(), _colours(curves)):
        greedy = greedy_msr(np.array(list(runs.values())))
        mean, error = greedy.mean(axis=0), greedy.std(axis=0, ddof=1) / len(greedy) ** 0.5
        steps = np.arange(len(mean))
        axes.plot(steps, mean, color=colour, label=name)
        axes.fill_between(steps, mean - error, mean + error, color=colour, alpha=0.25, linewidth=0)
    axes.axhline(REACHED, color="0.4", linestyle=":", linewidth=0.8)
    axes.set(xlabel="step $k$", ylim=(0, 1.1))
    axes.legend(loc="lower right", fontsize=8)


@styled
def draw_curves(axes: Axes, curves: Mapping[str, tuple[Curves, int]], label: str) -> None:
    """Draw running means of 25 steps of all runs, one of each configuration as a strong line.

    Args:
        axes: where.
        curves: by name: the curves of all runs, and the number of the strong one, which stands
            in the legend if there are others.
        label: of the vertical axis.
    """
    for (name, (runs, shown)), colour in zip(curves.items(), _colours(curves)):
        label_of_run = f"{name}, run {shown}" if len(runs) > 1 else name
        for run, values in runs.items():
            smooth = running_mean(values)
            if run == shown:
                axes.plot(smooth, color=colour, label=label_of_run, zorder=3)
            else:
                axes.plot(smooth, color=colour, linewidth=0.5, alpha=0.4)
    axes.set(xlabel="step $k$", ylabel=label)
    others = any(len(runs) > 1 for runs, _ in curves.values())
    note = "thin: the other runs of the same configuration" if others else None
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=2, title=note, title_fontsize=8)


def _colours(names: Collection[str]) -> list:
    """Of what the agents see; else a scale from dark to light, for the values of a setting."""
    scale = plt.get_cmap("viridis")(np.linspace(0, 0.85, len(names)))
    return [FE_COLOURS.get(name, colour) for name, colour in zip(names, scale)]


def _over_steps(curves: Mapping[str, tuple[Curves, int]], label: str) -> Figure:
    figure, axes = plt.subplots()
    draw_curves(axes, curves, label)
    steps = max(len(values) for runs, _ in curves.values() for values in runs.values())
    axes.set(xlim=(0, steps), ylim=(0, 0.6) if "loss" in label else (0, 1.02))
    return figure


@styled
def fig11_loss(folder: str | Path = paths.DATA) -> Figure:
    """Training loss over picks (Fig. 11), one line per seed; the first one is strong.

    Args:
        folder: of the curves that ``python -m studies training`` writes.

    Raises:
        FileNotFoundError: there are none.
    """
    losses = {seed: curve["loss"] for seed, curve in default_curves(folder).items()}
    return _over_picks(losses, r"loss $\ell$", (0, 0.6), folder)


@styled
def fig12_reward(folder: str | Path = paths.DATA) -> Figure:
    """Mean reward per pick of the 64 environments over picks (Fig. 12).

    Each point is a mean over an episode of all environments. Arguments, lines and errors as in
    ``fig11_loss``.
    """
    rewards = {
        seed: 2 * curve["success_rate"] - 1 for seed, curve in default_curves(folder).items()
    }
    return _over_picks(rewards, r"$r_\mathrm{mean}$", (-1, 1), folder)


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


def draw_by_pick(axes: Axes, curves: dict[str, np.ndarray], colours: Sequence[str]) -> None:
    """Draw the MSR over the picks of an episode, means over 20 picks.

    Args:
        axes: where.
        curves: (500,) each by name, see ``msr_by_pick``; dashed if it says "without the mask".
        colours: one for each curve.
    """
    for (name, msr), colour in zip(curves.items(), colours):
        means = msr.reshape(-1, 20).mean(axis=1)
        line = "--" if "without the mask" in name else "-"
        axes.plot(np.arange(10, len(msr), 20), means, line, color=colour, label=name)
    axes.set(xlabel="pick of the episode", ylabel="MSR", ylim=(0, 1.02), xlim=(0, task.MAX_PICKS))


def draw_values(axes: Axes, heights: np.ndarray, values: np.ndarray, liftable: np.ndarray) -> None:
    """Draw the action values of the visible items over their heights.

    Args:
        axes: where.
        heights: (items,) scaled to the container.
        values: (items,) of the network.
        liftable: (items,) bool, what can be lifted.
    """
    for name, rows in (("blocked", ~liftable), ("liftable", liftable)):
        axes.scatter(heights[rows], values[rows], s=10, color=BOX_COLOURS[name], label=name)
    axes.set(xlabel=r"height $\tilde p_z$", ylabel="action value", ylim=(-1.1, 1.1))


def draw_picks(axes: Axes, items: np.ndarray, unloaded: np.ndarray) -> None:
    """Draw each pick of an episode as a dot at its item.

    Args:
        axes: where.
        items: (picks,) int, the item of each pick.
        unloaded: (picks,) bool, whether the pick succeeded.
    """
    picks = np.arange(len(items))
    for name, rows, colour in (("failed", ~unloaded, "failed"), ("unloaded", unloaded, "liftable")):
        axes.scatter(picks[rows], items[rows], s=6, color=BOX_COLOURS[colour], label=name)
    axes.set(xlabel="pick of the episode", ylabel="item")


def _over_picks(
    curves: dict[int, pd.Series], label: str, limits: tuple[float, float], folder: str | Path
) -> Figure:
    figure, axes = plt.subplots()
    for number, (seed, values) in enumerate(curves.items()):
        style = {"linewidth": 0.8, "alpha": 0.8} if number else {"zorder": 3}
        axes.plot(values, color=SEED_COLOURS[number], label=f"seed {seed}", **style)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=4)
    end = max(values.index[-1] for values in curves.values())
    axes.set(xlabel="step $k$ (picks)", ylabel=label, ylim=limits, xlim=(0, end))
    axes.xaxis.set_major_formatter(EngFormatter(sep=" "))
    mark_reduced(figure, folder, PAPER.name)
    return figure
