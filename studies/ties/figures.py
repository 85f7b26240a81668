"""What ties do: how long an order of equals lasts, and where runs end by how ties are broken."""

from collections.abc import Callable, Mapping

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies.falls.long import LONG
from studies.grid import Grid, read_grid
from studies.paper.training import PAPER
from studies.statistics import PAPER_MSR, PAPER_START, by_run
from studies.style import COLOURS, WITHOUT_MASK, styled
from studies.ties.choice import COUNTS, WAYS
from studies.ties.criterion import likeness, open_course
from studies.ties.laboratory import RHOS
from studies.ties.training import EARLIER, SWEPT, TIES
from unload.physics.bullet import GAP

PICKS = 20_000_000  # of a run
# How ties are broken, in the order of the figure, and the cells of b = 256 that do so, without
# the ending that says whether the mask is on in training.
KINDS: dict[str, list[tuple[Grid, str]]] = {
    "items' order": [(EARLIER, "ties_by_order")],
    "averaged": [(PAPER, "averaged"), (TIES, "averaged")],
    "noise anew\nat each pick": [(TIES, "anew")],
    "noise renewed\nby a success": [(TIES, "renewed")],
    "noise that\ndrifts": [(TIES, "drifting")],
    "settled walls,\nfrozen": [(EARLIER, "ties_by_drift")],
    "noise,\nfrozen": [(PAPER, "paper"), (LONG, "ranks"), (TIES, "frozen")],
}

# What becomes of a pick, from the left, and its colour.
OUTCOMES = {"unloaded": "#4c9f70", "deadlocked": "0.25", "preference": "C1", "noise": "C0"}


def durations(table: pd.DataFrame) -> pd.DataFrame:
    """How long the order of equals lasts in PyBullet worlds that go on.

    Args:
        table: ``ties/noise``. It has a row per world, moment, lag in picks and axis. Of the boxes
            that nobody touches and that share their place along the axis, within a wall, with
            others: how many ``boxes`` there are; ``rms``, how far they move along it meanwhile, in
            mm, without the mean of their group; ``spearman``, the mean rank correlation of their
            offsets then and later.

    Returns:
        Means of these measures with the package's gap, by ``walls``, ``axis`` and ``lag``.
    """
    usual = table[table["gap"] == GAP]
    return usual.groupby(["walls", "axis", "lag"])[["boxes", "rms", "spearman"]].mean()


def read_by_ties() -> pd.DataFrame:
    """All published runs of the paper's configuration with b = 256, by how ties are broken.

    Returns:
        A row per run: ``ties``, ``mask``, ``cell``, ``seed``, and what ``criterion.likeness`` says.
    """
    curves = {grid.name: read_grid(grid) for grid in (PAPER, LONG, TIES, EARLIER)}
    rows = []
    for ties, cells in KINDS.items():
        for mask in (True, False):
            for grid, name in cells:
                # A cell of the long runs with the mask has no ending.
                ending = ("" if grid is LONG else "_mask") if mask else "_no_mask"
                table = curves[grid.name]
                found = table[table["cell"] == name + ending]
                if len(found):
                    runs = by_run(found, likeness)
                    runs.insert(0, "ties", ties.replace("\n", " "))
                    runs.insert(1, "mask", mask)
                    rows.append(runs)
    return pd.concat(rows, ignore_index=True)


@styled
def draw_ends(runs: pd.DataFrame) -> Figure:
    """The end of each run over how its ties are broken, with the mask in training and without.

    Args:
        runs: see ``read_by_ties``.
    """
    figure, panels = plt.subplots(2, 1, figsize=(7.6, 5.6), sharex=True, sharey=True)
    for axes, mask in zip(panels, (True, False)):
        for place, label in enumerate(KINDS):
            group = runs[(runs["ties"] == label.replace("\n", " ")) & (runs["mask"] == mask)]
            spread = np.linspace(-0.25, 0.25, len(group)) if len(group) > 1 else [0.0] * len(group)
            for fell, face in ((True, "none"), (False, "C1")):
                shown = (group["fell"] == fell).to_numpy()
                axes.plot(
                    place + np.asarray(spread)[shown], 100 * group["end"][shown], "o",
                    markersize=5, markeredgecolor="C1", markerfacecolor=face,
                )  # fmt: skip
            axes.text(place, 4, f"{len(group)} runs", ha="center", fontsize=9)
        axes.axhline(100 * PAPER_MSR, color="0.4", linestyle=":", linewidth=1)
        axes.set_xticks(range(len(KINDS)), KINDS, fontsize=9)
        axes.set(title=f"{'with' if mask else 'without'} the mask", ylim=(0, 103))
    figure.supylabel("MSR over the last tenth of the picks (%)", fontsize=10)
    return figure


def draw_words(
    axes: Axes, scale: Callable = lambda msr: msr, picks: float = PICKS, label: str | None = None
) -> None:
    """Draw what the paper says of its Fig. 12: its two numbers, and what its words leave open.

    Args:
        axes: over picks.
        scale: of an MSR.
        picks: of a run, in the unit of the axis.
        label: of the numbers.
    """
    share = np.array([0, 1e-9, 1])
    low, high = map(scale, open_course(share))
    axes.fill_between(picks * share, low, high, color="#f5eed6", zorder=0)
    ends = scale(np.array([PAPER_START, PAPER_MSR]))
    axes.plot([0, picks], ends, "k*", markersize=11, clip_on=False, zorder=4, label=label)


def read_by_duration() -> pd.DataFrame:
    """The published runs of b = 256 without the mask whose ties noise breaks, by its ρ.

    Returns:
        A row per run: ``rho``, the same along all axes, ``cell``, ``seed``, and what
        ``criterion.likeness`` says.
    """
    cells = {"anew_no_mask": RHOS[0], **{f"rho_{rho}_no_mask": rho for rho in SWEPT}}
    runs = by_run(read_grid(TIES).query("cell in @cells"), likeness)
    runs["rho"] = runs["cell"].map(cells)
    frozen = read_by_ties().query("ties == 'noise, frozen' and not mask")
    return pd.concat([runs, frozen.assign(rho=RHOS[-1])], ignore_index=True)


@styled
def draw_duration(runs: pd.DataFrame, long: pd.DataFrame) -> Figure:
    """Where runs end, by how long an order of equals lasts.

    Args:
        runs: ``ties/laboratory``; of its cells, those that differ in ρ, with the mask and without.
        long: see ``read_by_duration``.
    """
    figure, axes = plt.subplots(figsize=(5.6, 3.2))
    for ending, colour, label, shift in (
        ("", COLOURS["ranks"], "with the mask", -0.12),
        ("_no_mask", WITHOUT_MASK, "without the mask", 0.12),
    ):
        cells = [f"rho_{correlation}{ending}" for correlation in RHOS]
        ends = [100 * runs.loc[runs["cell"] == cell, "end"] for cell in cells]
        places = np.arange(len(RHOS)) + shift
        for place, values in zip(places, ends):
            axes.plot(place + np.linspace(-0.1, 0.1, len(values)), values, "o", c=colour, ms=3)
        means = [values.mean() for values in ends]
        axes.plot(places, means, "_-", c=colour, mec="k", ms=12, lw=1.2, label=label)
    places = long["rho"].map([*RHOS].index) + 0.3
    label = "20 million picks,\nwithout the mask"
    axes.plot(places, 100 * long["end"], "D", c=WITHOUT_MASK, mfc="none", ms=4, label=label)
    axes.legend(loc="lower left")
    axes.set_xticks(range(len(RHOS)), [f"{correlation:g}" for correlation in RHOS])
    axes.set(xlabel="ρ: correlation of the noise from one pick to the next", ylim=(0, 103))
    axes.set_ylabel("MSR over the last tenth (%)")
    return figure


@styled
def draw_ways(groups: Mapping[str, pd.DataFrame]) -> Figure:
    """What becomes of the picks of some networks, in each of the four ways to ask them.

    Args:
        groups: by the title of a panel, rows as ``choice.ask`` gives them, of one network or of
            several.
    """
    across = min(len(groups), 3)
    down = -(-len(groups) // across)
    size = (0.6 + 2.9 * across + 1.2 * (across == 1), 0.6 + 1.6 * down)
    figure, panels = plt.subplots(down, across, figsize=size, sharex=True, sharey=True)
    panels = np.atleast_1d(panels).ravel()
    for axes, (title, rows) in zip(panels, groups.items()):
        for place, (noise, mask) in enumerate(WAYS):
            counts = rows[(rows["noise"] == noise) & (rows["mask"] == mask)][COUNTS].mean()
            failures = 1 - counts["msr"]
            deadlocked, preference = (
                failures * counts[name] / max(counts["failures"], 1)
                for name in ("deadlocked", "preference")
            )
            others = failures - deadlocked - preference
            start = 0.0
            shares = counts["msr"], deadlocked, preference, others
            for (name, colour), share in zip(OUTCOMES.items(), shares):
                axes.barh(place, 100 * share, left=100 * start, color=colour, label=name)
                start += share
            axes.text(2, place, f"{counts['msr']:.0%}", va="center", color="white", fontsize=9)
        axes.set(title=title, xlim=(0, 100), ylim=(len(WAYS) - 0.5, -0.5))
        axes.set_yticks(
            range(len(WAYS)),
            [f"{noise}, {'mask' if mask else 'no mask'}" for noise, mask in WAYS],
            fontsize=9,
        )
        axes.grid(axis="y", visible=False)
    for axes in panels[len(groups) :]:
        axes.set_axis_off()
    for axes in panels[len(groups) - across : len(groups)]:
        axes.set_xlabel("% of the picks")
    handles = panels[0].get_legend_handles_labels()[0][: len(OUTCOMES)]
    figure.legend(handles, OUTCOMES, loc="outside lower center", ncols=4, fontsize=9)
    return figure
