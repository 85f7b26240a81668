"""The policies compared, by the lift table and with every box simulated."""

from pathlib import Path

import matplotlib.pyplot as plt
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
