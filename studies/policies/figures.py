"""The policies compared, by the lift table and with every box simulated; and one from inside.

From inside: how it learned, what it prefers, and what noise does to it.
"""

from collections.abc import Mapping
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from studies import paths
from studies.policies.comparison import PLAYERS
from studies.results import COMMAND, read_table
from studies.statistics import bootstrap_interval
from studies.style import COLOURS, styled

# Conditions from left to right and top to bottom; those of ``comparison`` and, with every box
# simulated, those of ``robustness``.
FULL = {"restore": "full, restored", "keep": "full, kept"}
CONDITIONS = (
    "500 picks", *FULL.values(),
    "σ 0.5 cm", "σ 2 cm", "σ 5 cm",
    "complete", "boxes × 0.8", "boxes × 1.2",
)  # fmt: skip
COLUMNS = 3
ROWS = {(policy, mask): policy if mask else f"{policy}, no mask" for policy, mask in PLAYERS}
SEEN = {"paper": "ranks", "paper_seed_2": "ranks", "recommended": "positions"}
NOT_PLAYED = "–"  # with every box simulated: without the mask, and restored by most policies


def read_comparison(folder: str | Path = paths.DATA) -> pd.DataFrame:
    """Every container that a policy has unloaded.

    Returns:
        One row per container: ``policy``, ``mask``, ``condition`` (one of ``CONDITIONS``) and
        ``success_rate``.
    """
    place, command = Path(folder) / "policies", f"{COMMAND} policies"
    columns = ["policy", "mask", "condition", "success_rate"]
    table = read_table(place / "comparison.csv", command, columns)
    full = read_table(place / "robustness.csv", command, ["policy", "after_pick", "success_rate"])
    full = full.assign(mask=True, condition=full["after_pick"].map(FULL))
    return pd.concat([table, full], ignore_index=True)[columns]


@styled
def comparison_msr(folder: str | Path = paths.DATA) -> Figure:
    """MSR of every policy: a panel for each condition, dots with 95 % intervals.

    Hollow dots are played without the mask.
    """
    table = read_comparison(folder)
    figure, panels = plt.subplots(
        len(CONDITIONS) // COLUMNS, COLUMNS, figsize=(8.4, 6.2), sharex=True, sharey=True
    )
    for axes, condition in zip(panels.flat, CONDITIONS):
        _panel(axes, table[table["condition"] == condition])
        axes.set_title(condition, loc="left")
    panels[0, 0].set(xlim=(0, 1.04), ylim=(len(ROWS) - 0.5, -0.5))
    panels[0, 0].set_yticks(range(len(ROWS)), ROWS.values())
    panels[0, 0].xaxis.set_major_formatter(PercentFormatter(1, symbol=""))
    for axes in panels[-1]:
        axes.set_xlabel("MSR (%)")
    return figure


def _panel(axes: Axes, table: pd.DataFrame) -> None:
    """All policies under one condition."""
    rates = dict(list(table.groupby(["policy", "mask"])["success_rate"]))
    count = max(map(len, rates.values()))
    axes.set_title(f"{count} containers", loc="right", fontsize=7, color="0.45")
    for row, (policy, mask) in enumerate(ROWS):
        if (policy, mask) not in rates:
            axes.text(0.03, row, NOT_PLAYED, va="center", fontsize=7, color="0.45")
            continue
        rate = rates[policy, mask]
        colour = COLOURS[SEEN.get(policy, policy)]
        axes.plot(bootstrap_interval(rate), [row, row], color=colour)
        axes.plot(rate.mean(), row, "o", color=colour, markerfacecolor=colour if mask else "white",
                  markersize=5, clip_on=False, zorder=3)  # fmt: skip


@styled
def learning(curve: pd.DataFrame, greedy: pd.Series) -> Figure:
    """A training run: MSR of the exploring agent and of its greedy policy, and the loss.

    Args:
        curve: of ``unload.train``.
        greedy: MSR of the greedy policy on fresh containers, indexed by picks.
    """
    figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3))
    thousands = curve["picks"] / 1000
    colour = COLOURS["positions"]
    left.plot(thousands, curve["success_rate"], color=colour, alpha=0.45, label="exploring agent")
    left.plot(thousands, curve["epsilon"], color="0.6", label="exploration rate ε")
    left.plot(
        greedy.index / 1000, greedy, "o-", color=colour, ms=4, label="greedy, fresh containers"
    )
    left.set(xlabel="picks (thousands)", ylabel="MSR", ylim=(0, 1.03))
    left.yaxis.set_major_formatter(PercentFormatter(1))
    left.legend()
    right.plot(thousands, curve["loss"], color=colour)
    right.set(xlabel="picks (thousands)", ylabel=r"loss $\ell$", ylim=(0, None))
    return figure


@styled
def preferences(
    z: np.ndarray, by_height: Mapping[str, np.ndarray], y: np.ndarray, field: np.ndarray
) -> Figure:
    """What a policy prefers: over the height, and across the front wall.

    Args:
        z: (m,) heights in m.
        by_height: name of a place → (m,) preference over the height.
        y: (k,) places across the container in m.
        field: (m, k) preference at the front wall.
    """
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6))
    for (name, values), line in zip(by_height.items(), ("-", "--", ":")):
        left.plot(z, values, line, color=COLOURS["positions"], label=name)
    left.set(xlabel="height z (m)", ylabel=r"preference $a \cdot f$")
    left.set_title("in the middle of the width")
    left.legend()
    lines = right.contour(y, z, field, levels=20)
    right.set(xlabel="width y (m)", ylabel="height z (m)", title="front wall, from the entrance")
    right.set_aspect("equal")
    figure.colorbar(lines, label=r"preference $a \cdot f$")
    return figure


@styled
def steps(metres: np.ndarray, slope: float, ranks: np.ndarray) -> Figure:
    """Steps from a box to one that lies on it, in metres and in ranks.

    Args:
        metres: (n, 2) float, to the side and up, in m.
        slope: height in m that a metre to the side is worth to the policy, at most.
        ranks: (m, 3) float, differences of the ranks of x, y and z.
    """
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6))
    left.plot(*metres.T, "o", color=COLOURS["positions"], markersize=4)
    flattest = (metres[:, 1] / np.abs(metres[:, 0]).clip(1e-9)).min()
    side = np.array([-0.6, 0, 0.6])
    left.plot(side, flattest * np.abs(side), color="0.5", linestyle="--", label="flattest step")
    left.plot(side, slope * np.abs(side), color="black", label="the policy's slope, at most")
    left.set(xlabel="to the side (m)", ylabel="up (m)", ylim=(0, 0.45), title="steps in metres")
    for axis, colour, name in ((0, "0.5", "along x"), (1, COLOURS["ranks"], "along y")):
        right.plot(ranks[:, axis], ranks[:, 2], "o", markersize=1.5, alpha=0.3, color=colour,
                   label=name)  # fmt: skip
    right.set(xlabel="to the side or along the container (ranks)", ylabel="up (ranks)")
    right.set(ylim=(0, None), title="steps in ranks")
    for axes, scale in ((left, 1), (right, 3)):
        axes.legend(loc="upper right", fontsize=8, framealpha=1, frameon=True, markerscale=scale)
    return figure
