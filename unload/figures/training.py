"""Figs. 11 and 12: the training in the container (Sec. IV-B)."""

from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

from unload import checks, files, task
from unload.figures.style import mark_reduced, styled

COLUMNS = ["Wall time", "Step", "Value"]


@styled
def fig11_loss(folder: str | Path = files.DATA) -> Figure:
    """Training loss over picks (Fig. 11).

    Args:
        folder: of ``loss_function_agent.csv``, which ``python -m unload.reproduce training``
            writes.

    Raises:
        FileNotFoundError, ValueError: see ``read_curve``.
    """
    curve = read_curve(folder, "loss_function_agent")
    return _figure(curve["Step"], curve["Value"], r"loss $\ell$", (0, 0.6), folder)


@styled
def fig12_reward(folder: str | Path = files.DATA) -> Figure:
    """Mean reward per pick of the 64 environments over picks (Fig. 12).

    Arguments and errors as in ``fig11_loss``, for ``total_rew_function_agent.csv``.
    """
    curve = read_curve(folder, "total_rew_function_agent")
    reward = curve["Value"] / task.MAX_PICKS
    return _figure(curve["Step"], reward, r"$r_\mathrm{mean}$", (-0.75, 1), folder)


def read_curve(folder: str | Path, name: str) -> pd.DataFrame:
    """A curve with the columns ``Wall time``, ``Step`` and ``Value``.

    Raises:
        FileNotFoundError: it is missing; the message says how to compute it.
        ValueError: the file has other columns, no rows, or values that are not finite.
    """
    path = Path(folder) / f"{name}.csv"
    if not path.is_file():
        raise FileNotFoundError(
            f"{path} is missing; python -m unload.reproduce training computes it"
        )
    table = pd.read_csv(path)
    if list(table.columns) != COLUMNS:
        raise ValueError(f"{path} has columns {list(table.columns)}; expected {COLUMNS}")
    checks.finite_array(f"{path}", table, (None, len(COLUMNS)))
    if table.empty:
        raise ValueError(f"{path} has no rows; expected at least one")
    return table


def _figure(
    steps: pd.Series,
    values: pd.Series,
    label: str,
    limits: tuple[float, float],
    folder: str | Path,
) -> Figure:
    figure, axes = plt.subplots()
    axes.plot(steps, values)
    axes.set(xlabel="step $k$ (picks)", ylabel=label, ylim=limits, xlim=(0, steps.iloc[-1]))
    axes.xaxis.set_major_formatter(EngFormatter(sep=" "))
    mark_reduced(figure, folder, "training")
    return figure
