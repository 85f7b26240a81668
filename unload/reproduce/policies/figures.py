"""The policies compared, under all conditions: by the lift table, and with every box simulated."""

from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from unload.reproduce.policies.comparison import PLAYERS
from unload.reproduce.results import COMMAND, read_table
from unload.reproduce.statistics import with_intervals
from unload.reproduce.style import COLOURS, styled
from unload.support import files

KEY = ["policy", "mask", "condition"]
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


def read_comparison(folder: str | Path = files.DATA) -> pd.DataFrame:
    """Every container that a policy has unloaded.

    Args:
        folder: of the data.

    Returns:
        One row per container: ``policy``, ``mask``, ``condition`` (one of ``CONDITIONS``) and
        ``success_rate``.

    Raises:
        FileNotFoundError: a table is missing; the message says how to compute it.
        ValueError: a table lacks a column.
    """
    place = Path(folder) / "policies"
    columns = [*KEY, "success_rate"]
    table = read_table(place / "comparison.csv", f"{COMMAND} policies", columns)
    columns = ["policy", "after_pick", "success_rate"]
    full = read_table(place / "robustness.csv", f"{COMMAND} policies", columns)
    full = full.assign(mask=True, condition=full["after_pick"].map(FULL))
    return pd.concat([table, full], ignore_index=True)[[*KEY, "success_rate"]]


def comparison_means(folder: str | Path = files.DATA) -> pd.DataFrame:
    """Mean MSR and 95 % bootstrap interval over the containers.

    Returns:
        Index ``policy``, ``mask``, ``condition``; columns ``runs``, how many containers,
        ``success_rate``, ``success_rate_low`` and ``success_rate_high``.

    Raises:
        FileNotFoundError, ValueError: see ``read_comparison``.
    """
    return with_intervals(read_comparison(folder), KEY, ["success_rate"]).set_index(KEY)


@styled
def comparison_msr(folder: str | Path = files.DATA) -> Figure:
    """MSR of every policy: a panel for each condition, dots with 95 % intervals.

    Hollow dots are played without the mask.

    Args:
        folder: of the data.

    Raises:
        FileNotFoundError, ValueError: see ``read_comparison``.
    """
    means = comparison_means(folder)
    figure, panels = plt.subplots(
        len(CONDITIONS) // COLUMNS, COLUMNS, figsize=(8.4, 6.2), sharex=True, sharey=True
    )
    for axes, condition in zip(panels.flat, CONDITIONS):
        _panel(axes, means.xs(condition, level="condition"))
        axes.set_title(condition, loc="left")
    panels[0, 0].set(xlim=(0, 1.04), ylim=(len(ROWS) - 0.5, -0.5))
    panels[0, 0].set_yticks(range(len(ROWS)), ROWS.values())
    panels[0, 0].xaxis.set_major_formatter(PercentFormatter(1, symbol=""))
    for axes in panels[-1]:
        axes.set_xlabel("MSR (%)")
    return figure


def _panel(axes: Axes, means: pd.DataFrame) -> None:
    """All policies under one condition."""
    axes.set_title(f"{means['runs'].max():.0f} containers", loc="right", fontsize=7, color="0.45")
    for row, (policy, mask) in enumerate(ROWS):
        if (policy, mask) not in means.index:
            axes.text(0.03, row, NOT_PLAYED, va="center", fontsize=7, color="0.45")
            continue
        _, mean, low, high = means.loc[policy, mask]
        colour = COLOURS[SEEN.get(policy, policy)]
        axes.plot([low, high], [row, row], color=colour)
        axes.plot(mean, row, "o", color=colour, markerfacecolor=colour if mask else "white",
                  markersize=5, clip_on=False, zorder=3)  # fmt: skip
