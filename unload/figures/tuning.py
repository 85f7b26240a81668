"""Figs. 8–10: learning curves in the hyperparameter-tuning environment (Sec. IV-A)."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from unload import files
from unload.figures.style import mark_reduced, styled
from unload.sweep import STEPS, set_name

WINDOW = 25  # steps of the running mean drawn over the raw curve


@styled
def fig08_learning_rate(folder: str | Path = files.DATA) -> Figure:
    """MSR over training steps for three learning rates, batch size 1024 (Fig. 8).

    Args:
        folder: of the curves that ``python -m unload.reproduce tuning`` writes.

    Raises:
        FileNotFoundError: a curve is missing.
    """
    curves = {
        r"$\mu = 10^{-1}$": "hitrate_curve_bz_1024_lr_0.1_agent_6",
        r"$\mu = 10^{-2}$": "hitrate_curve_bz_1024_lr_0.01_agent_7",
        r"$\mu = 10^{-3}$": "hitrate_curve_bz_1024_lr_0.001_agent_5",
    }
    return _figure({name: read_curve(folder, file) for name, file in curves.items()}, "MSR", folder)


@styled
def fig09_batch_size(folder: str | Path = files.DATA) -> Figure:
    """MSR over training steps for four batch sizes, learning rate 10⁻³ (Fig. 9).

    Arguments and errors as in ``fig08_learning_rate``.
    """
    curves = {
        "$b = 64$": "hitrate_curve_bz_64_lr_0.001_agent_9",
        "$b = 256$": "hitrate_curve_bz_256_lr_0.001_agent_9",
        "$b = 1024$": "hitrate_curve_bz_1024_lr_0.001_agent_5",
        "$b = 2048$": "hitrate_curve_bz_2048_lr_0.001_agent_6",
    }
    return _figure({name: read_curve(folder, file) for name, file in curves.items()}, "MSR", folder)


@styled
def fig10_loss(folder: str | Path = files.DATA) -> Figure:
    """Loss over training steps with and without feature engineering, b = 2048 (Fig. 10).

    Arguments and errors as in ``fig08_learning_rate``.
    """
    curves = {
        "with FE": read_curve(folder, "loss_curve_bz_2048_lr_0.001_agent_6"),
        "without FE": read_curve(folder, "loss_curve_bz_2048_lr_0.001_agent_8", equalize=False),
    }
    return _figure(curves, r"loss $\ell$", folder)


def read_curve(folder: str | Path, name: str, equalize: bool = True) -> np.ndarray:
    """One value per training step, (steps,) float64, NaN where there is none yet.

    Raises:
        FileNotFoundError: the curve is missing; the message says how to compute it.
        ValueError: the file is not one column of numbers.
    """
    path = Path(folder) / set_name(equalize) / f"{name}.csv"
    if not path.is_file():
        raise FileNotFoundError(f"{path} is missing; python -m unload.reproduce tuning computes it")
    try:
        curve = pd.read_csv(path, header=None, skip_blank_lines=False, dtype=float)
    except ValueError as error:
        raise ValueError(f"{path} is not a column of numbers: {error}") from error
    if curve.shape[1] != 1:
        raise ValueError(f"{path} has {curve.shape[1]} columns; expected one")
    return curve[0].to_numpy()


@styled
def draw_curves(axes: Axes, curves: Mapping[str, np.ndarray], label: str) -> None:
    """Draw curves over their steps: raw ones pale, running means of 25 steps on top."""
    for number, (name, values) in enumerate(curves.items()):
        steps = np.arange(len(values))
        axes.plot(steps, values, color=f"C{number}", alpha=0.2, linewidth=0.6)
        smooth = pd.Series(values).rolling(WINDOW, min_periods=1, center=True).mean()
        axes.plot(steps, smooth, color=f"C{number}", label=name)
    axes.set(xlabel="step $k$", ylabel=label)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=4)


def _figure(curves: Mapping[str, np.ndarray], label: str, folder: str | Path) -> Figure:
    figure, axes = plt.subplots()
    draw_curves(axes, curves, label)
    axes.set(xlim=(0, STEPS), ylim=(0, 1.02) if label == "MSR" else (0, 0.6))
    mark_reduced(figure, folder, "tuning")
    return figure
