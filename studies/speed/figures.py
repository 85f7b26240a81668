"""How fast the parts are, mostly drawn from what ``studies.speed.run`` measured."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from studies import paths
from studies.results import read_table
from studies.style import styled

FOLDER = paths.DATA / "benchmarks"
COLUMNS = ["what", "how", "value", "unit", "ratio"]


def read_speeds(folder: str | Path = FOLDER) -> pd.DataFrame:
    """The table of the benchmarks, a row per way of doing a thing."""
    return read_table(Path(folder) / "speeds.csv", "python -m studies.speed.run", COLUMNS)


def three_digits(value: float) -> str:
    """A positive number rounded to three digits, without a power of ten: 1,230,000."""
    return f"{float(f'{value:.3g}'):,.10g}"


@styled
def speed_ratios(folder: str | Path = FOLDER) -> Figure:
    """Speed ratio of each implementation to the first one."""
    table = read_speeds(folder)
    groups = table.groupby("what", sort=False)
    figure, panels = plt.subplots(
        len(groups), 1, figsize=(6.4, 0.34 * len(table) + 0.5 * len(groups)), sharex=True,
        height_ratios=[len(group) + 0.6 for _, group in groups],
    )  # fmt: skip
    for number, (axes, (what, group)) in enumerate(zip(np.atleast_1d(panels), groups)):
        places = np.arange(len(group))
        axes.barh(places, group["ratio"], color=f"C{number}")
        for place, ratio, value, unit in zip(places, group["ratio"], group["value"], group["unit"]):
            text = f"{three_digits(value)} {unit}"
            axes.text(max(ratio, 1) * 1.15, place, text, va="center", fontsize=8)
        axes.set_yticks(places, group["how"], fontsize=8)
        axes.set(xscale="log", ylim=(len(group) - 0.4, -0.6), xlim=(0.5, 20 * table["ratio"].max()))
        axes.set_title(what, loc="left", fontsize=9)
        axes.minorticks_off()
        axes.grid(False, axis="y")
    axes.set_xlabel("times as fast as the first way of its kind")
    return figure
