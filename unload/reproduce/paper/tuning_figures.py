"""Figs. 8–10: learning curves in the hyperparameter-tuning environment (Sec. IV-A)."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from unload.reproduce.paper.grids import TUNING
from unload.reproduce.paper.tuning import REACHED, greedy_msr, read_curves, running_mean
from unload.reproduce.style import mark_reduced, styled
from unload.support import files

Curves = dict[int, np.ndarray]  # one value per training step, by the number of the run


@styled
def fig08_learning_rate(folder: str | Path = files.DATA) -> Figure:
    """MSR while training over steps for three learning rates, batch size 1024 (Fig. 8).

    The strong lines are the runs that the paper shows; the thin ones are all others.

    Args:
        folder: of the curves that ``python -m unload.reproduce tuning`` writes.

    Raises:
        FileNotFoundError: there are none.
    """
    curves = {
        rf"$\mu = 10^{{-{power}}}$": (
            read_curves("success_rate", 1024, 10.0**-power, folder=folder), shown
        )
        for power, shown in ((1, 6), (2, 7), (3, 5))
    }  # fmt: skip
    return _figure(curves, "MSR while training", folder)


@styled
def fig09_batch_size(folder: str | Path = files.DATA) -> Figure:
    """MSR while training over steps for four batch sizes, learning rate 10⁻³ (Fig. 9).

    Arguments, lines and errors as in ``fig08_learning_rate``.
    """
    curves = {
        f"$b = {batch_size}$": (read_curves("success_rate", batch_size, 1e-3, folder=folder), shown)
        for batch_size, shown in ((64, 9), (256, 9), (1024, 5), (2048, 6))
    }
    return _figure(curves, "MSR while training", folder)


@styled
def fig10_loss(folder: str | Path = files.DATA) -> Figure:
    """Loss over training steps with and without feature engineering, b = 2048 (Fig. 10).

    Arguments, lines and errors as in ``fig08_learning_rate``.
    """
    curves = {
        "with FE": (read_curves("loss", 2048, 1e-3, True, folder), 6),
        "without FE": (read_curves("loss", 2048, 1e-3, False, folder), 8),
    }
    return _figure(curves, r"loss $\ell$", folder)


@styled
def greedy_curves(folder: str | Path = files.DATA) -> Figure:
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
    mark_reduced(figure, folder, TUNING.name)
    return figure


@styled
def draw_greedy(axes: Axes, curves: Mapping[str, Curves]) -> None:
    """Draw the mean greedy MSR of each configuration's runs, with a band of one standard error.

    Args:
        axes: where.
        curves: MSR while training of all runs, by the configuration's name.
    """
    for number, (name, runs) in enumerate(curves.items()):
        greedy = greedy_msr(np.array(list(runs.values())))
        mean, error = greedy.mean(axis=0), greedy.std(axis=0, ddof=1) / len(greedy) ** 0.5
        steps = np.arange(len(mean))
        axes.plot(steps, mean, color=f"C{number}", label=name)
        axes.fill_between(
            steps, mean - error, mean + error, color=f"C{number}", alpha=0.25, linewidth=0
        )
    axes.axhline(REACHED, color="0.4", linestyle=":", linewidth=0.8)
    axes.set(xlabel="step $k$", ylim=(0, 1.1))
    axes.legend(loc="lower right", fontsize=8)


@styled
def draw_curves(axes: Axes, curves: Mapping[str, tuple[Curves, int]], label: str) -> None:
    """Draw running means of 25 steps of all runs, one of each configuration as a strong line.

    Args:
        axes: where.
        curves: by name: the curves of all runs, and the number of the strong one; the first
            one if that is missing.
        label: of the vertical axis.
    """
    for number, (name, (runs, shown)) in enumerate(curves.items()):
        strong = shown if shown in runs else min(runs)
        for run, values in runs.items():
            smooth = running_mean(values)
            if run == strong:
                axes.plot(smooth, color=f"C{number}", label=name, zorder=3)
            else:
                axes.plot(smooth, color=f"C{number}", linewidth=0.5, alpha=0.4)
    axes.set(xlabel="step $k$", ylabel=label)
    others = any(len(runs) > 1 for runs, _ in curves.values())
    note = "thin: the other runs of the same configuration" if others else None
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=4, title=note, title_fontsize=8)


def _figure(curves: Mapping[str, tuple[Curves, int]], label: str, folder: str | Path) -> Figure:
    figure, axes = plt.subplots()
    draw_curves(axes, curves, label)
    steps = max(len(values) for runs, _ in curves.values() for values in runs.values())
    axes.set(xlim=(0, steps), ylim=(0, 0.6) if "loss" in label else (0, 1.02))
    mark_reduced(figure, folder, TUNING.name)
    return figure
