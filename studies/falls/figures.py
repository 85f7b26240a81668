"""The figures of why runs fall."""

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies.falls.cells import PREFERENCES, PUPILS
from studies.falls.laboratory import ERRS, THRESHOLDS
from studies.paper.training import PAPER_CELLS
from studies.statistics import PAPER_MSR, end_msr, t_interval
from studies.style import COLOURS, styled
from unload import task

MOST_PREFERENCE = 1.5  # larger ones are drawn at the edge
NAMES = {  # of what ``PUPILS`` see and store, in their order
    "ranks": "ranks",
    "shuffled": "shuffled places",
    "averaged": "ties averaged",
    "level": "level loads",
}
PAPER_KINDS = {  # what the paper's four cells are called
    name: f"mask {'on' if cell.config.mask else 'off'}, b = {cell.config.batch_size}"
    for name, cell in PAPER_CELLS.items()
}


@styled
def four_cells(curves: pd.DataFrame) -> Figure:
    """MSR while training of every run of the paper's four cells, and the end of each.

    Args:
        curves: see ``read_grid``; other cells are left out.
    """
    figure, panels = plt.subplots(2, 2, figsize=(7, 4.6), sharex=True, sharey=True)
    for axes, (name, kind) in zip(panels.flat, PAPER_KINDS.items()):
        runs = [run for _, run in curves[curves["cell"] == name].groupby("seed")]
        for run in runs:
            axes.plot(run["picks"] / 1e6, 100 * run["success_rate"], "C1", lw=0.5, alpha=0.5)
        ends = 100 * np.array([end_msr(run) for run in runs])
        axes.plot(np.full(len(ends), 21), ends, "k.", ms=4)
        low, high = t_interval(ends)
        axes.errorbar(
            22.3, ends.mean(), [[ends.mean() - low], [high - ends.mean()]],
            fmt="k_", capsize=3,
        )  # fmt: skip
        axes.axhline(100 * PAPER_MSR, color="0.4", ls=":", lw=1)
        axes.set(title=f"{kind}: {len(runs)} runs", xlim=(0, 23), ylim=(0, 102))
    figure.supxlabel("million picks; dots: mean over the last tenth, with its 95 % t interval")
    figure.supylabel("MSR while training (%)")
    return figure


@styled
def dug(
    surface: np.ndarray, preferences: tuple[float, float], ties: str, msr: float, rules: np.ndarray
) -> Figure:
    """What a rule leaves of the loads, seen from above, and its place among all such rules.

    Args:
        surface: what ``measures.surface`` returns.
        preferences: of the rule, along x and y.
        ties: see ``unload.equalize``.
        msr: of the rule, in [0, 1].
        rules: that of the others, see ``measures.rules``.
    """
    figure, (left, right) = plt.subplots(1, 2, figsize=(8.6, 3.6), width_ratios=(1.4, 1))
    length, width, height = task.CONTAINER
    place = {"origin": "lower", "extent": (0, length, 0, width)}
    image = left.imshow(surface.T, "viridis", vmin=0, vmax=height, **place)
    figure.colorbar(image, ax=left, location="bottom", label="mean height of the load (m)")
    left.set(xlabel="x, depth (m); the entrance is at the right", ylabel="y, across (m)")
    left.set_title("what 300 picks leave, from above")
    left.grid(False)
    along_x, along_y = (MOST_PREFERENCE if ties == "average" else THRESHOLDS[0]), THRESHOLDS[1]
    right.set_facecolor("#f6d5c9")
    right.add_patch(plt.Rectangle((-along_x, -along_y), 2 * along_x, 2 * along_y, color="white"))
    axis = np.linspace(-MOST_PREFERENCE, MOST_PREFERENCE, len(rules))
    right.contour(axis, axis, rules, [ERRS], colors="black")
    errs, colour = ("errs", "C1") if msr < ERRS else ("does not err", "C0")
    right.plot(*preferences, "o", color=colour, ms=12, clip_on=False)
    right.set(xlabel="preference along x (depth)", ylabel="along y (across)")
    right.set_title(f"MSR {msr:.1%}: it {errs}")
    return figure


@styled
def loop(trace: pd.DataFrame, runs: pd.DataFrame) -> Figure:
    """How a preference grows: what it does to the load, and what a network learns from that.

    Args:
        trace, runs: the tables of ``laboratory.laboratory_data``.
    """
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(9, 3.5))
    for cell in ("ranks", "shuffled"):
        points = trace[trace["cell"] == cell]
        preference = points["slope_y"] / points["slope_z"].abs()
        left.plot(preference, points["tilt_y"], ".", color=COLOURS[cell], ms=3, label=NAMES[cell])
    left.set(xlabel="preference: slope across / upward", ylabel="tilt of the load", xlim=(-2, 2))
    middle.plot([0, max(PREFERENCES)], [0, max(PREFERENCES)], "0.6", ls="--", lw=1)
    for pupil, (kind, name) in zip(PUPILS, NAMES.items()):
        cells = [f"{pupil}_{preference}" for preference in PREFERENCES]
        groups = [runs[runs["cell"] == cell] for cell in cells]
        learned = [(group["slope_y"] / group["slope_z"].abs()).mean() for group in groups]
        middle.plot(PREFERENCES, learned, "o-", ms=3, color=COLOURS[kind], label=name)
        if pupil == "taught":
            success = [100 * group["mean"].mean() for group in groups]
            right.plot(PREFERENCES, success, "o-", ms=3, color=COLOURS[kind])
    middle.set(xlabel="preference of the teacher", ylabel="preference of the pupil")
    # Its colours are those of the other panels, whose data leave no room for a legend.
    figure.legend(*middle.get_legend_handles_labels(), loc="outside upper center", ncols=4)
    right.set(xlabel="preference of the teacher", ylabel="teacher's MSR (%)", ylim=(0, 102))
    return figure


@styled
def fall(points: pd.DataFrame) -> Figure:
    """A run before and in its fall: MSR and mistakes, preference, tilt.

    Args:
        points: of one run, see ``laboratory.point``.
    """
    figure, panels = plt.subplots(3, 1, figsize=(6.5, 5.6), sharex=True)
    picks = points["picks"] / 1e6
    panels[0].plot(picks, 100 * points["success_rate"], "k", label="MSR while training")
    panels[0].plot(picks, 100 * points["wrong"], "C1", label="highest score is blocked")
    panels[0].plot(
        picks, 100 * points["wrong_without_place"], "C0", label="the same with x = y = 0"
    )
    panels[0].plot(
        picks, 50 * (1 + points["height_of_wrong"]), "C1.", ms=3, label="its rank in height"
    )
    panels[0].set(ylabel="%", ylim=(-2, 102))
    for axis, style in (("x", ":"), ("y", "-")):
        preference = points[f"slope_{axis}"] / points["slope_z"].abs()
        panels[1].plot(picks, preference, f"C3{style}", label=f"along {axis}")
        panels[2].plot(picks, points[f"tilt_{axis}"], f"C4{style}", label=f"along {axis}")
    panels[1].set(ylabel="preference")
    panels[2].set(ylabel="tilt of the load", xlabel="million picks")
    for axes in panels:
        axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1, 0.5))
    return figure


@styled
def ends(runs: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """MSR over the last tenth, a dot per run and a line per cell.

    Args:
        runs: ``cell`` and ``end``.
        names: cell → what it is called; drawn from top to bottom.
    """
    figure, axes = plt.subplots(figsize=(6.5, 0.27 * len(names) + 0.8))
    rng = np.random.default_rng(0)  # dots of a line are spread a little, to be told apart
    for line, cell in enumerate(names):
        end = 100 * runs.loc[runs["cell"] == cell, "end"]
        heights = line + rng.uniform(-0.2, 0.2, len(end))
        axes.plot(end, heights, ".", color="C0" if end.min() >= 97 else "C1", ms=5, alpha=0.6)
    axes.set(xlim=(0, 101), ylim=(len(names) - 0.4, -0.6), xlabel="MSR over the last tenth (%)")
    axes.set_yticks(range(len(names)), names.values())
    axes.grid(axis="y", visible=False)
    return figure


def draw_phase(axes: Axes, rows: pd.DataFrame, averaged: bool) -> None:
    """Networks by their preferences along x and y, coloured by whether they err.

    The shaded region is where the rule of ``laboratory.predicted`` says that a network errs.

    Args:
        axes: where.
        rows: with ``slope_x``, ``slope_y``, ``slope_z`` and ``judged_as_is``.
        averaged: whether equal x share one rank.
    """
    along_x, along_y = THRESHOLDS
    axes.axhspan(along_y, MOST_PREFERENCE, color="#f6d5c9", zorder=0)
    if not averaged:
        axes.fill_between([along_x, MOST_PREFERENCE], 0, along_y, color="#f6d5c9", zorder=0)
    preferences = rows[["slope_x", "slope_y"]].abs().div(rows["slope_z"].abs(), axis=0)
    preferences = preferences.clip(upper=0.98 * MOST_PREFERENCE)
    errs = rows["judged_as_is"] < ERRS
    for name, chosen, colour in (("errs", errs, "C1"), ("does not", ~errs, "C0")):
        places = preferences[chosen]
        axes.plot(
            places["slope_x"], places["slope_y"], "o", color=colour, markersize=4, alpha=0.7,
            markeredgewidth=0, label=f"{name}: {len(places)}",
        )  # fmt: skip
    limits = 0, MOST_PREFERENCE
    axes.set(xlabel="|preference| along x (depth)", xlim=limits, ylim=limits)
