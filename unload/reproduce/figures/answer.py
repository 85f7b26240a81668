"""Why 60 %: the runs of the plan, each of them shown."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from unload.reproduce.answer import CELLS, PAPER_CELLS, read_answer
from unload.reproduce.changes import CHANGES
from unload.reproduce.figures.style import hide_unused, styled
from unload.reproduce.interventions import START, read_interventions
from unload.reproduce.survival import constant_chance, surviving
from unload.reproduce.verdict import PAPER_MSR, WINDOW_PICKS, cell_table, end_msr, windows
from unload.support import checks, files


def _chosen(cells: Mapping[str, str], folder: str | Path) -> dict[str, list]:
    """The runs of some cells, as ``(cell, seed, curve)``; cells without any are left out."""
    return _grouped("cells", cells, CELLS, read_answer(folder))


def _grouped(argument: str, names: Iterable[str], known: Iterable[str], runs: Iterable) -> dict:
    """Runs by their first entry, in the order of ``names``, which must be known ones."""
    for name in names:
        checks.one_of(argument, name, known)
    groups = {name: [] for name in names}
    for run in runs:
        if run[0] in groups:
            groups[run[0]].append(run)
    return {name: found for name, found in groups.items() if found}


@styled
def cells_msr(cells: Mapping[str, str] = PAPER_CELLS, folder: str | Path = files.DATA) -> Figure:
    """MSR while training over the last tenth of the picks: a dot for each run.

    The measure is that of the paper's Fig. 12. Under the dots stands their mean with its 95 % t
    interval, which the ends of the scale cut off.

    Args:
        cells: names in ``unload.reproduce.answer.CELLS`` → text; those without a run are left out.
        folder: of the data.

    Raises:
        ValueError: an unknown cell.
    """
    runs = _chosen(cells, folder)
    figure, axes = plt.subplots(figsize=(6.4, 0.9 + 0.48 * len(runs)))
    names = []
    for row, (cell, found) in enumerate(runs.items()):
        ends = np.sort([end_msr(curve) for _, _, curve in found])
        axes.plot(ends, np.full(len(ends), row - 0.12), "o", color="C0", alpha=0.6, markersize=5)
        table = cell_table(found).iloc[0]
        if len(ends) > 1:
            interval = np.clip([table["low"], table["high"]], 0, 1)
            axes.plot(interval, [row + 0.24] * 2, color="0.2", linewidth=1.2)
        axes.plot(table["mean"], row + 0.24, "|", color="0.2", markersize=9, markeredgewidth=1.8)
        names.append(f"{cells[cell]}\n{len(ends)} run{'s' * (len(ends) > 1)}")
    axes.axvline(PAPER_MSR, color="C1", linestyle=":")
    axes.text(PAPER_MSR, 1.02, "the paper's run", color="C1", ha="center", va="bottom",
              transform=axes.get_xaxis_transform(), fontsize=9)  # fmt: skip
    axes.set_yticks(range(len(names)), names, fontsize=9)
    axes.set(
        xlim=(0, 1.02),
        ylim=(len(names) - 0.5, -0.5),
        xlabel="MSR while training, last tenth of 20 million picks",
    )
    axes.xaxis.set_major_formatter(PercentFormatter(1))
    axes.grid(False, axis="y")
    return figure


@styled
def cell_curves(
    cells: Mapping[str, str] = PAPER_CELLS, columns: int = 2, folder: str | Path = files.DATA
) -> Figure:
    """MSR while training of each run, over windows of half a million picks; a panel for each cell.

    Args:
        cells: as for ``cells_msr``.
        columns: panels in a line.
        folder: of the data.

    Raises:
        ValueError: an unknown cell, or no cell has a run.
    """
    runs = _chosen(cells, folder)
    if not runs:
        raise ValueError(f"cells is {list(cells)}, of which none has a run; expected data of one")
    return _courses({cells[cell]: found for cell, found in runs.items()}, columns)


@styled
def intervention_curves(
    changes: Mapping[str, str], columns: int = 3, folder: str | Path = files.DATA
) -> Figure:
    """MSR while training of the runs that were changed on the way, as in ``cell_curves``.

    The dashed line is the time of the change.

    Args:
        changes: names in ``unload.reproduce.changes.CHANGES`` → text; those without a run are
            left out.
        columns: panels in a line.
        folder: of the data.

    Raises:
        ValueError: an unknown change, or no change has a run.
    """
    runs = _grouped("changes", changes, CHANGES, read_interventions(folder))
    found = {changes[change]: each for change, each in runs.items()}
    if not found:
        raise ValueError(
            f"changes is {list(changes)}, of which none has a run; expected data of one"
        )
    figure = _courses(found, columns)
    for axes in filter(Axes.get_visible, figure.axes):
        axes.axvline(START / 1e6, color="0.4", linestyle="--", linewidth=0.8)
    return figure


def _courses(runs: Mapping[str, Sequence[tuple]], columns: int) -> Figure:
    """MSR of runs, ``(…, seed, curve)``, over windows; a panel for each title."""
    columns = min(checks.integer("columns", columns, 1), len(runs))
    lines = -(-len(runs) // columns)
    figure, grid = plt.subplots(
        lines, columns, figsize=(7.8, 0.6 + 1.25 * lines), sharex=True, sharey=True,
        squeeze=False,
    )  # fmt: skip
    hide_unused(grid, len(runs))
    for axes, (title, found) in zip(grid.flat, runs.items()):
        for _, seed, curve in found:
            msr = windows(curve)["success_rate"]
            middles = (msr.index + 0.5) * WINDOW_PICKS / 1e6
            colour = plt.get_cmap("viridis")(seed / 10)
            axes.plot(middles, msr, color=colour, linewidth=1, label=seed)
        axes.axhline(PAPER_MSR, color="C1", linestyle=":")
        axes.set_title(f"{title} ({len(found)} runs)", fontsize=9)
    grid[0, 0].set_ylim(0, 1.02)
    grid[0, 0].yaxis.set_major_formatter(PercentFormatter(1))
    figure.supxlabel("picks (millions)", fontsize=9)
    figure.supylabel("MSR while training", fontsize=9)
    return figure


@styled
def falls_and_replay(
    cell: str, seeds: Sequence[int], replay: int, folder: str | Path = files.DATA
) -> Figure:
    """MSR while training of some runs, and the share of failures in their replay memory.

    Args:
        cell: a name in ``unload.reproduce.answer.CELLS``.
        seeds: of the runs, one panel each.
        replay: picks that the replay memory holds.
        folder: of the data.

    Raises:
        ValueError: an unknown cell, or a run is not there.
    """
    found = {seed: curve for _, seed, curve in _chosen({cell: ""}, folder).get(cell, [])}
    for seed in seeds:
        checks.one_of("seeds", seed, found)
    figure, panels = plt.subplots(
        len(seeds), 1, figsize=(6.4, 0.6 + 1.5 * len(seeds)), sharex=True, squeeze=False
    )
    for axes, seed in zip(panels.flat, seeds):
        curve = found[seed]
        millions = curve["picks"] / 1e6
        points = round(replay / np.diff(curve["picks"].iloc[:2])[0])
        failures = 1 - curve["success_rate"].rolling(points, min_periods=1).mean()
        msr = windows(curve)["success_rate"]
        axes.plot((msr.index + 0.5) * WINDOW_PICKS / 1e6, msr, color="C0")
        axes.set(ylim=(0, 1.02), ylabel=f"MSR, seed {seed}")
        axes.yaxis.set_major_formatter(PercentFormatter(1))
        other = axes.twinx()
        other.semilogy(millions, failures, color="C1", linewidth=1)
        other.set(ylim=(1e-4, 1), ylabel="failures")
        other.grid(False)
        other.yaxis.label.set_color("C1")
    panels.flat[-1].set_xlabel("picks (millions)")
    return figure


@styled
def survival(before: Mapping[str, np.ndarray], columns: int = 5) -> Figure:
    """Share of episodes without a mistake, pick by pick, and that of a constant chance of failure.

    Args:
        before: name of a policy → (episodes,) successes before its first mistake, see
            ``unload.reproduce.survival``.
        columns: panels in a line.

    Raises:
        ValueError: ``before`` is empty.
    """
    columns = checks.integer("columns", columns, 1)
    if not before:
        raise ValueError("before is empty; expected at least one policy")
    columns = min(columns, len(before))
    lines = -(-len(before) // columns)
    figure, grid = plt.subplots(
        lines, columns, figsize=(1.9 * columns + 0.4, 0.7 + 1.5 * lines), sharex=True, sharey=True,
        squeeze=False,
    )  # fmt: skip
    hide_unused(grid, len(before))
    for axes, (name, successes) in zip(grid.flat, before.items()):
        share = surviving(successes)
        picks = np.arange(len(share))
        axes.plot(picks, share, color="C0", label="episodes")
        expected = (1 - constant_chance(successes)) ** picks
        axes.plot(
            picks, expected, "--", color="0.4", linewidth=1, label="if the chance were constant"
        )
        axes.set_title(name, fontsize=8)
    grid[0, 0].set_ylim(0, 1.02)
    grid[0, 0].yaxis.set_major_formatter(PercentFormatter(1))
    figure.supxlabel("pick of the episode", fontsize=9)
    figure.supylabel("without a mistake", fontsize=9)
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure
