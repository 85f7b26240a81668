"""The figures of why agents go wrong."""

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from studies.falls.cells import PREFERENCES, PUPILS
from studies.falls.laboratory import ERRS, THRESHOLDS, preferences
from studies.paper.training import PAPER_CELLS
from studies.statistics import PAPER_MSR
from studies.style import COLOURS, WITHOUT_MASK, styled
from unload import task
from unload.agent.config import TrainConfig

MOST_PREFERENCE = 1.5  # larger ones are drawn at the edge
ALONG_X, ALONG_Y = "preference along x: rear – entrance", "along y: left – right"
DARK_IS_HIGH = "viridis_r"
SHADE = "#f6d5c9"
NAMES = {  # of what ``PUPILS`` see and store, in their order
    "ranks": "ranks",
    "shuffled": "shuffled places",
    "averaged": "ties averaged",
    "level": "level loads",
}
PAPER_KINDS = {  # what the paper's four cells are called
    name: f"{'with' if cell.config.mask else 'without'} the mask, b = {cell.config.batch_size}"
    for name, cell in PAPER_CELLS.items()
}


@styled
def worth(runs: pd.DataFrame) -> Figure:
    """What agents of the paper's four cells do in new containers, over what their curves end at.

    Args:
        runs: ``cell``; ``end``, see ``end_msr``; and ``judged_as_is``, the MSR in new containers,
            with the mask.
    """
    figure, axes = plt.subplots(figsize=(5.6, 4))
    axes.plot([0, 100], [0, 100], "0.6", ls="--", lw=1)
    for name, kind in PAPER_KINDS.items():
        config, rows = PAPER_CELLS[name].config, runs[runs["cell"] == name]
        axes.plot(
            100 * rows["end"], 100 * rows["judged_as_is"],
            "o" if config.batch_size == TrainConfig().batch_size else "^",
            color=COLOURS["ranks"] if config.mask else WITHOUT_MASK, alpha=0.8, ms=6,
            label=f"{kind} ({len(rows)})", clip_on=False,
        )  # fmt: skip
    axes.axvline(100 * PAPER_MSR, color="0.4", ls=":", lw=1)
    axes.set(xlim=(0, 100), ylim=(0, 100), xlabel="MSR while training, last tenth (%)")
    axes.set_ylabel("MSR in new containers, with the mask (%)")
    axes.legend(loc="lower left", fontsize=8)
    return figure


@styled
def dug(
    surface: np.ndarray, preferences: tuple[float, float], msr: float, rules: np.ndarray
) -> Figure:
    """What a rule leaves of the loads, seen from above, and its place among all such rules.

    Args:
        surface: what ``measures.surface`` returns.
        preferences: of the rule, along x and y.
        msr: of the rule, in [0, 1].
        rules: that of others, whose preferences go from -1.5 to 1.5 in even steps, along y in the
            rows and along x in the columns.
    """
    figure, (left, right) = plt.subplots(1, 2, figsize=(8.8, 3.9), width_ratios=(1.3, 1))
    length, width, height = task.CONTAINER
    place = {"origin": "lower", "extent": (0, length, 0, width)}
    image = left.imshow(surface.T, DARK_IS_HIGH, vmin=0, vmax=height, **place)
    figure.colorbar(image, ax=left, location="bottom", label="mean height of the load (m)")
    left.set(xlabel="x, depth (m): rear – entrance", ylabel="y, across (m)")
    left.set_title("what 300 picks leave, from above")
    left.grid(False)
    axis = np.linspace(-MOST_PREFERENCE, MOST_PREFERENCE, len(rules))
    image = right.pcolormesh(axis, axis, 100 * rules, cmap=DARK_IS_HIGH, vmin=0, vmax=100)
    figure.colorbar(image, ax=right, location="bottom", label="MSR of the rule there (%)")
    right.contour(axis, axis, rules, [ERRS], colors="white")
    errs, colour = ("errs", "C1") if msr < ERRS else ("does not err", "white")
    right.plot(*preferences, "o", color=colour, mec="black", ms=11, clip_on=False)
    right.set(xlabel=ALONG_X, ylabel=ALONG_Y)
    right.set_title(f"MSR {msr:.1%}: it {errs}")
    right.grid(False)
    return figure


@styled
def loop(trace: pd.DataFrame, runs: pd.DataFrame) -> Figure:
    """How a preference grows: what it does to the load, and what a network learns from that.

    Args:
        trace, runs: the tables of ``laboratory.laboratory_data``.
    """
    figure, (left, right) = plt.subplots(1, 2, figsize=(7.6, 3.5))
    for cell in ("ranks", "shuffled"):
        points = trace[trace["cell"] == cell]
        preference = points["slope_y"] / points["slope_z"].abs()
        left.plot(preference, points["tilt_y"], ".", color=COLOURS[cell], ms=3, label=NAMES[cell])
    left.set(xlabel="preference along y", ylabel="tilt of the load", xlim=(-2, 2))
    right.plot([0, max(PREFERENCES)], [0, max(PREFERENCES)], "0.6", ls="--", lw=1)
    for pupil, (kind, name) in zip(PUPILS, NAMES.items()):
        cells = [f"{pupil}_{preference}" for preference in PREFERENCES]
        groups = [runs[runs["cell"] == cell] for cell in cells]
        learned = [(group["slope_y"] / group["slope_z"].abs()).mean() for group in groups]
        right.plot(PREFERENCES, learned, "o-", ms=3, color=COLOURS[kind], label=name)
    right.set(xlabel="preference of the teacher", ylabel="preference of the pupil")
    # Its colours are those of the other panel, whose data leave no room for a legend.
    figure.legend(*right.get_legend_handles_labels(), loc="outside upper center", ncols=4)
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


@styled
def phase(networks: Mapping[str, pd.DataFrame], rules: Mapping[str, np.ndarray]) -> Figure:
    """Networks by their preferences along x and y, coloured by whether they err.

    The shaded region is where ``laboratory.predicted`` says that a network errs. Within the black
    line no rule ``measures.preferring`` does.

    Args:
        networks: by how ties are broken, a title; each with ``slope_x``, ``slope_y``, ``slope_z``
            and ``judged_as_is``. Equal x share a rank in the last of them.
        rules: by the same titles, see ``dug``.
    """
    figure, panels = plt.subplots(1, len(networks), figsize=(8.4, 4), sharex=True, sharey=True)
    edge = 0.98 * MOST_PREFERENCE
    for axes, (title, rows) in zip(panels, networks.items()):
        along_x, along_y = THRESHOLDS
        if axes is panels[-1]:
            along_x = MOST_PREFERENCE
        axes.set_facecolor(SHADE)
        corner, size = (-along_x, -along_y), (2 * along_x, 2 * along_y)
        axes.add_patch(plt.Rectangle(corner, *size, color="white", zorder=0))
        line = np.linspace(-MOST_PREFERENCE, MOST_PREFERENCE, len(rules[title]))
        axes.contour(line, line, rules[title], [ERRS], colors="black", linewidths=1)
        along, errs = preferences(rows).clip(-edge, edge), rows["judged_as_is"] < ERRS
        for name, chosen, colour in (("errs", errs, "C1"), ("does not", ~errs, "C0")):
            axes.plot(
                along["x"][chosen], along["y"][chosen], "o",
                color=colour, ms=5, alpha=0.8, mew=0, label=f"{name}: {chosen.sum()}",
            )  # fmt: skip
        limits = -MOST_PREFERENCE, MOST_PREFERENCE
        axes.set(xlabel=ALONG_X, xlim=limits, ylim=limits, title=title)
        axes.legend(loc="upper right", fontsize=8)
    panels[0].set_ylabel(ALONG_Y)
    return figure
