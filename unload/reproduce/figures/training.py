"""Figs. 11 and 12: the training in the container (Sec. IV-B), and learning curves by episode."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

from unload import task
from unload.load.colours import COLOURS
from unload.reproduce.results import read_table
from unload.reproduce.style import mark_reduced, styled
from unload.reproduce.training import episode_means
from unload.support import files
from unload.support.provenance import read_provenance

COLUMNS = ["Wall time", "Step", "Value"]
SEED_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")  # told apart by the colour-blind, too


@styled
def fig11_loss(folder: str | Path = files.DATA) -> Figure:
    """Training loss over picks (Fig. 11), one line per seed; the first one is strong.

    Args:
        folder: of ``loss_function_agent.csv`` and ``loss_function_agent_seed_*.csv``, which
            ``python -m unload.reproduce training`` writes.

    Raises:
        FileNotFoundError, ValueError: see ``read_curves``.
    """
    curves = read_curves(folder, "loss_function_agent")
    return _figure(curves, r"loss $\ell$", (0, 0.6), folder)


@styled
def fig12_reward(folder: str | Path = files.DATA) -> Figure:
    """Mean reward per pick of the 64 environments over picks (Fig. 12).

    Arguments, lines and errors as in ``fig11_loss``, for ``total_rew_function_agent*.csv``.
    """
    curves = read_curves(folder, "total_rew_function_agent")
    means = {
        seed: curve.assign(Value=curve["Value"] / task.MAX_PICKS) for seed, curve in curves.items()
    }
    return _figure(means, r"$r_\mathrm{mean}$", (-1, 1), folder)


def read_curves(folder: str | Path, name: str) -> dict[int, pd.DataFrame]:
    """The curve ``name`` and those of the other seeds, ``<name>_seed_*``, by their seeds.

    Raises:
        FileNotFoundError, ValueError: see ``read_curve``.
    """
    first = read_curve(folder, name)
    prefix = f"{name}_seed_"
    others = [path.stem for path in Path(folder).glob(f"{prefix}*.csv")]
    seeds = sorted(int(each.removeprefix(prefix)) for each in others)
    curves = {read_provenance(folder, "training")["settings"]["seeds"][0]: first}
    return curves | {seed: read_curve(folder, f"{prefix}{seed}") for seed in seeds}


def read_curve(folder: str | Path, name: str) -> pd.DataFrame:
    """A curve with the columns ``Wall time``, ``Step`` and ``Value``.

    Raises:
        FileNotFoundError: it is missing; the message says how to compute it.
        ValueError: the file has other columns, no rows, or values that are not finite.
    """
    path = Path(folder) / f"{name}.csv"
    return read_table(path, "python -m unload.reproduce training", COLUMNS, exact=True)


def draw_learning_curve(axes: Axes, curve: pd.DataFrame, name: str, color: str = "C0") -> None:
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


def draw_by_pick(axes: Axes, curves: dict[str, np.ndarray]) -> None:
    """Draw the MSR over the picks of an episode, means over 20 picks.

    Args:
        axes: where.
        curves: (500,) each by name, see ``msr_by_pick``.
    """
    for name, msr in curves.items():
        means = msr.reshape(-1, 20).mean(axis=1)
        axes.plot(np.arange(10, len(msr), 20), means, label=name)
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
        axes.scatter(heights[rows], values[rows], s=10, color=COLOURS[name], label=name)
    axes.set(xlabel=r"height $\tilde p_z$", ylabel="action value", ylim=(-1.1, 1.1))


def _figure(
    curves: dict[int, pd.DataFrame], label: str, limits: tuple[float, float], folder: str | Path
) -> Figure:
    figure, axes = plt.subplots()
    for number, (seed, curve) in enumerate(curves.items()):
        style = {"linewidth": 0.8, "alpha": 0.8} if number else {"zorder": 3}
        color = SEED_COLOURS[number % len(SEED_COLOURS)]
        axes.plot(curve["Step"], curve["Value"], color=color, label=f"seed {seed}", **style)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=4)
    end = max(curve["Step"].iloc[-1] for curve in curves.values())
    axes.set(xlabel="step $k$ (picks)", ylabel=label, ylim=limits, xlim=(0, end))
    axes.xaxis.set_major_formatter(EngFormatter(sep=" "))
    mark_reduced(figure, folder, "training")
    return figure
