"""Figs. 11 and 12: the training in the container (Sec. IV-B)."""

from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

from unload import task
from unload.reproduce.figures.style import mark_reduced, styled
from unload.reproduce.results import read_table
from unload.support import files

COLUMNS = ["Wall time", "Step", "Value"]


@styled
def fig11_loss(folder: str | Path = files.DATA) -> Figure:
    """Training loss over picks (Fig. 11); the first run strong, those of other seeds pale.

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
    means = [curve.assign(Value=curve["Value"] / task.MAX_PICKS) for curve in curves]
    return _figure(means, r"$r_\mathrm{mean}$", (-1, 1), folder)


def read_curves(folder: str | Path, name: str) -> list[pd.DataFrame]:
    """The curve ``name`` and those of the other seeds, ``<name>_seed_*``.

    Raises:
        FileNotFoundError, ValueError: see ``read_curve``.
    """
    others = sorted(path.stem for path in Path(folder).glob(f"{name}_seed_*.csv"))
    return [read_curve(folder, each) for each in (name, *others)]


def read_curve(folder: str | Path, name: str) -> pd.DataFrame:
    """A curve with the columns ``Wall time``, ``Step`` and ``Value``.

    Raises:
        FileNotFoundError: it is missing; the message says how to compute it.
        ValueError: the file has other columns, no rows, or values that are not finite.
    """
    path = Path(folder) / f"{name}.csv"
    return read_table(path, "python -m unload.reproduce training", COLUMNS, exact=True)


def _figure(
    curves: list[pd.DataFrame], label: str, limits: tuple[float, float], folder: str | Path
) -> Figure:
    figure, axes = plt.subplots()
    axes.plot(curves[0]["Step"], curves[0]["Value"], label="first run", zorder=3)
    for number, curve in enumerate(curves[1:]):
        name = None if number else "other seeds"
        axes.plot(curve["Step"], curve["Value"], color="C1", linewidth=0.6, alpha=0.7, label=name)
    if len(curves) > 1:
        axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=2)
    end = max(curve["Step"].iloc[-1] for curve in curves)
    axes.set(xlabel="step $k$ (picks)", ylabel=label, ylim=limits, xlim=(0, end))
    axes.xaxis.set_major_formatter(EngFormatter(sep=" "))
    mark_reduced(figure, folder, "training")
    return figure
