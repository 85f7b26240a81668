"""Figs. 8–10: learning curves in the hyperparameter-tuning environment (Sec. IV-A)."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from unload.reproduce.style import mark_reduced, styled
from unload.reproduce.tuning import REACHED, greedy_msr, run_name, running_mean, set_name
from unload.support import files

Curves = dict[int, np.ndarray]  # one value per training step, by the number of the run


@styled
def fig08_learning_rate(folder: str | Path = files.DATA) -> Figure:
    """MSR while training over steps for three learning rates, batch size 1024 (Fig. 8).

    The strong lines are the runs that the paper shows, or the first one there is; the thin
    ones are all others.

    Args:
        folder: of the curves that ``python -m unload.reproduce tuning`` writes.

    Raises:
        FileNotFoundError: there is no run of a configuration.
    """
    curves = {
        r"$\mu = 10^{-1}$": (read_curves(folder, "hitrate", 1024, 1e-1), 6),
        r"$\mu = 10^{-2}$": (read_curves(folder, "hitrate", 1024, 1e-2), 7),
        r"$\mu = 10^{-3}$": (read_curves(folder, "hitrate", 1024, 1e-3), 5),
    }
    return _figure(curves, "MSR while training", folder)


@styled
def fig09_batch_size(folder: str | Path = files.DATA) -> Figure:
    """MSR while training over steps for four batch sizes, learning rate 10⁻³ (Fig. 9).

    Arguments, lines and errors as in ``fig08_learning_rate``.
    """
    curves = {
        f"$b = {batch_size}$": (read_curves(folder, "hitrate", batch_size, 1e-3), shown)
        for batch_size, shown in ((64, 9), (256, 9), (1024, 5), (2048, 6))
    }
    return _figure(curves, "MSR while training", folder)


@styled
def fig10_loss(folder: str | Path = files.DATA) -> Figure:
    """Loss over training steps with and without feature engineering, b = 2048 (Fig. 10).

    Arguments, lines and errors as in ``fig08_learning_rate``.
    """
    curves = {
        "with FE": (read_curves(folder, "loss", 2048, 1e-3), 6),
        "without FE": (read_curves(folder, "loss", 2048, 1e-3, equalize=False), 8),
    }
    return _figure(curves, r"loss $\ell$", folder)


@styled
def greedy_curves(folder: str | Path = files.DATA) -> Figure:
    """Greedy MSR by learning rate, batch size and feature engineering: the runs of Figs. 8–10.

    Each line is the mean over all runs of a configuration, its band one standard error.

    Arguments and errors as in ``fig08_learning_rate``.
    """
    panels = {
        "with FE, b = 1024": {
            f"μ = {rate:g}": read_curves(folder, "hitrate", 1024, rate)
            for rate in (1e-1, 1e-2, 1e-3)
        },
        "with FE, μ = 0.001": {
            f"b = {batch_size}": read_curves(folder, "hitrate", batch_size, 1e-3)
            for batch_size in (64, 256, 1024, 2048)
        },
        "μ = 0.001, b = 2048": {
            f"{'with' if equalize else 'without'} FE": read_curves(
                folder, "hitrate", 2048, 1e-3, equalize
            )
            for equalize in (True, False)
        },
    }
    figure, all_axes = plt.subplots(1, 3, figsize=(9.6, 3.2), sharey=True)
    for axes, (title, curves), end in zip(all_axes, panels.items(), (3000, 600, 600)):
        draw_greedy(axes, curves)
        axes.set(title=title, xlim=(0, end))
    all_axes[0].set_ylabel("greedy MSR")
    mark_reduced(figure, folder, "tuning")
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


def read_curves(
    folder: str | Path, kind: str, batch_size: int, learning_rate: float, equalize: bool = True
) -> Curves:
    """The curves of all runs of a configuration, by the number of the run.

    Args:
        folder: of the data.
        kind: ``"hitrate"`` or ``"loss"``.
        batch_size: b.
        learning_rate: μ.
        equalize: with feature engineering or without.

    Raises:
        FileNotFoundError: there is none; the message says how to compute it.
        ValueError: see ``read_curve``.
    """
    name = f"{kind}_curve_{run_name(batch_size, learning_rate, '*')}"
    paths = (Path(folder) / set_name(equalize)).glob(f"{name}.csv")
    runs = sorted(int(path.stem.rpartition("_")[2]) for path in paths)
    if not runs:
        read_curve(folder, name, equalize)  # says that it is missing
    return {run: read_curve(folder, name.replace("*", str(run)), equalize) for run in runs}


def read_curve(folder: str | Path, name: str, equalize: bool = True) -> np.ndarray:
    """One value per training step, (steps,) float64, NaN where there is none yet.

    Raises:
        FileNotFoundError: the curve is missing; the message says how to compute it.
        ValueError: the file is not one column of numbers.
    """
    path = Path(folder) / set_name(equalize) / f"{name}.csv"
    if not path.is_file():
        raise FileNotFoundError(f"{path} is missing; python -m unload.reproduce tuning makes it")
    try:
        curve = pd.read_csv(path, header=None, skip_blank_lines=False, dtype=float)
    except ValueError as error:
        raise ValueError(f"{path} is not a column of numbers: {error}") from error
    if curve.shape[1] != 1:
        raise ValueError(f"{path} has {curve.shape[1]} columns; expected one")
    return curve[0].to_numpy()


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
    mark_reduced(figure, folder, "tuning")
    return figure
