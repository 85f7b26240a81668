"""The policies compared, under all conditions: by the lift table, and with every box simulated."""

from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from unload.reproduce.comparison import COMPARED, LEARNED
from unload.reproduce.results import read_table
from unload.reproduce.robustness import RESTORED
from unload.reproduce.statistics import with_intervals
from unload.reproduce.style import styled
from unload.support import files

KEY = ["policy", "mask", "condition"]
# Conditions from left to right and top to bottom; those of ``reproduce.comparison`` and, with
# every box simulated, those of ``reproduce.robustness``.
FULL = {"restore": "full, restored", "keep": "full, kept"}
CONDITIONS = (
    "500 picks", *FULL.values(),
    "σ 0.5 cm", "σ 2 cm", "σ 5 cm",
    "complete", "boxes × 0.8", "boxes × 1.2",
)  # fmt: skip
COLUMNS = 3
# Who plays, by policy and mask: the rules with it only.
ROWS = {
    (policy, mask): policy if mask else f"{policy}, no mask"
    for policy in COMPARED
    for mask in ((True, False) if policy in LEARNED else (True,))
}
COLOURS = {
    "random": "C5", "nearest": "C3", "highest": "C2",
    "paper": "C1", "paper_seed_2": "C1", "recommended": "C0",
}  # fmt: skip
ABSENT = "–"


def read_comparison(folder: str | Path = files.DATA) -> pd.DataFrame:
    """Every container that a policy has unloaded.

    Args:
        folder: of ``comparison.csv`` and ``robustness.csv``. The latter takes hours and may be
            absent, or hold some of the policies only.

    Returns:
        One row per container: ``policy``, ``mask``, ``condition`` (one of ``CONDITIONS``) and
        ``success_rate``. Full physics is always played with the mask.

    Raises:
        FileNotFoundError: there is no ``comparison.csv``; the message says how to compute it.
        ValueError: a table lacks a column.
    """
    path = Path(folder) / "comparison.csv"
    table = read_table(path, "python -m unload.reproduce comparison", [*KEY, "success_rate"])
    path = Path(folder) / "robustness.csv"
    if path.is_file():
        columns = ["policy", "after_pick", "success_rate"]
        full = read_table(path, "python -m unload.reproduce robustness", columns)
        full = full[full["after_pick"].isin(FULL)]
        full = full.assign(mask=True, condition=full["after_pick"].map(FULL))
        table = pd.concat([table, full], ignore_index=True)
    return table[[*KEY, "success_rate"]]


def comparison_means(folder: str | Path = files.DATA) -> pd.DataFrame:
    """Mean MSR and 95 % bootstrap interval over the containers.

    Returns:
        Index ``policy``, ``mask``, ``condition``; columns ``runs``, how many containers,
        ``success_rate``, ``success_rate_low`` and ``success_rate_high``.

    Raises:
        FileNotFoundError, ValueError: see ``read_comparison``.
    """
    return with_intervals(read_comparison(folder), KEY, ["success_rate"]).set_index(KEY)


def not_played(folder: str | Path = files.DATA) -> list[str]:
    """The combinations of policy and condition that the data does not hold, in words.

    Raises:
        FileNotFoundError, ValueError: see ``read_comparison``.
    """
    played = comparison_means(folder).index
    return [
        f"{name}: {condition}"
        for condition in CONDITIONS
        for (policy, mask), name in ROWS.items()
        if (policy, mask, condition) not in played and _meant(policy, mask, condition)
    ]


def _meant(policy: str, mask: bool, condition: str) -> bool:
    """Whether it is ever played: in full physics with the mask, and restored by few policies."""
    if condition not in FULL.values():
        return True
    return mask and (condition != FULL["restore"] or policy in RESTORED)


def comparison_table(folder: str | Path = files.DATA) -> pd.DataFrame:
    """MSR in percent with its 95 % interval, as text to read.

    Returns:
        One row per condition and one column per policy, learned ones with and without the
        mask. A cell is such as ``"79.4 (77.2–81.6)"``; ``"100"`` if not a single pick failed,
        and ``"–"`` if it was not played.

    Raises:
        FileNotFoundError, ValueError: see ``read_comparison``.
    """
    means = comparison_means(folder)
    cells = {
        name: [_cell(means, (policy, mask, condition)) for condition in CONDITIONS]
        for (policy, mask), name in ROWS.items()
    }
    return pd.DataFrame(cells, index=pd.Index(CONDITIONS, name="MSR in %"))


def _cell(means: pd.DataFrame, key: tuple[str, bool, str]) -> str:
    if key not in means.index:
        return ABSENT
    mean, low, high = 100 * means.loc[key].drop("runs")
    return "100" if mean == 100 else f"{mean:.1f} ({low:.1f}–{high:.1f})"


@styled
def comparison_msr(folder: str | Path = files.DATA) -> Figure:
    """MSR of every policy: a panel for each condition, dots with 95 % intervals.

    Hollow dots are played without the mask.

    Args:
        folder: of the tables.

    Raises:
        FileNotFoundError, ValueError: see ``read_comparison``.
    """
    means = comparison_means(folder)
    figure, panels = plt.subplots(
        len(CONDITIONS) // COLUMNS, COLUMNS, figsize=(8.4, 6.2), sharex=True, sharey=True
    )
    for axes, condition in zip(panels.flat, CONDITIONS):
        _panel(axes, means, condition)
    panels[0, 0].set(xlim=(0, 1.04), ylim=(len(ROWS) - 0.5, -0.5))
    panels[0, 0].set_yticks(range(len(ROWS)), ROWS.values())
    panels[0, 0].xaxis.set_major_formatter(PercentFormatter(1, symbol=""))
    for axes in panels[-1]:
        axes.set_xlabel("MSR (%)")
    return figure


def _panel(axes: Axes, means: pd.DataFrame, condition: str) -> None:
    """All policies under one condition."""
    counts = means.loc[means.index.get_level_values("condition") == condition, "runs"]
    axes.set_title(condition, loc="left")
    if len(counts):
        number = "–".join(str(count) for count in sorted({counts.min(), counts.max()}))
        axes.set_title(f"{number} containers", loc="right", fontsize=7, color="0.45")
    for row, (policy, mask) in enumerate(ROWS):
        key = (policy, mask, condition)
        if key not in means.index:
            text = "not played" if _meant(*key) else ABSENT
            axes.text(0.03, row, text, va="center", fontsize=7, color="0.45")
            continue
        _, mean, low, high = means.loc[key]
        colour = COLOURS[policy]
        axes.plot([low, high], [row, row], color=colour)
        axes.plot(mean, row, "o", color=colour, markerfacecolor=colour if mask else "white",
                  markersize=5, clip_on=False, zorder=3)  # fmt: skip
