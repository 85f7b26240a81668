"""Lifts: as a sequence of positions, seen from the entrance, and by two ways of asking."""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Polygon, Rectangle

from studies.style import styled
from unload import task
from unload.load.picture import COLOURS


@styled
def distance_curves(
    panels: Mapping[str, Mapping[str, tuple[np.ndarray, np.ndarray, np.ndarray]]],
    marks: Mapping[str, float],
) -> Figure:
    """How far a box is lifted: lines by a formula, dots as they were measured.

    Args:
        panels: label of the horizontal axis → curves; these are name → (x, formula, measured),
            three (k,) float arrays, distances in m.
        marks: label of the horizontal axis → a value of it that a grey line marks.
    """
    figure, grid = plt.subplots(
        1, len(panels), figsize=(3.4 * len(panels) + 1, 3.2), sharey=True, squeeze=False
    )
    for axes, (label, curves) in zip(grid[0], panels.items()):
        for number, (name, (x, formula, measured)) in enumerate(curves.items()):
            axes.plot(x, formula, color=f"C{number}")
            axes.plot(x, measured, "o", ms=3.5, color=f"C{number}", label=name)
        axes.axhline(task.LIFT_THRESHOLD, color="C5", ls="--", lw=1, label="threshold")
        if label in marks:
            axes.axvline(marks[label], color="#bbbbbb", lw=1, zorder=0)
        axes.set_xlabel(label)
        axes.legend(fontsize=8)
    grid[0, 0].set_ylabel("distance moved (m)")
    return figure


@styled
def lift_sequences(
    lifts: Mapping[str, tuple[np.ndarray, np.ndarray]],
    times: Sequence[float],
) -> Figure:
    """One line of pictures for each lift.

    The chosen box is "liftable" or "blocked": it has moved by 0.2 m in the last picture, or not.

    Args:
        lifts: label → (sizes, poses) of a situation's boxes, the chosen one first and the
            one on it next; all others cannot move. ``sizes`` is (boxes, 2) float, width and
            height in m; ``poses`` (times, boxes, 3) float, y and z of the centre in m and the
            angle of rotation about the x axis in rad.
        times: when the poses were taken, s.
    """
    figure, grid = plt.subplots(
        len(lifts), len(times), figsize=(10, 2.05 * len(lifts) + 0.3), squeeze=False
    )
    meanings = {}
    for line, (label, (sizes, poses)) in zip(grid, lifts.items()):
        reach = np.hypot(*sizes[:2].T)[:, None] / 2  # of the moving boxes, however they turn
        low = (poses[:, :2, :2] - reach).min((0, 1))
        high = (poses[:, :2, :2] + reach).max((0, 1))
        moved = np.hypot(*(poses[-1] - poses[0])[0, :2]) >= task.LIFT_THRESHOLD
        chosen = "liftable" if moved else "blocked"
        meanings[f"chosen box, {chosen}"] = COLOURS[chosen]
        for axes, time, pose in zip(line, times, poses):
            _draw_boxes(axes, sizes, pose, COLOURS[chosen])
            axes.set(
                xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xticks=[], yticks=[]
            )
            axes.set_title(f"{time:.2f} s", fontsize=8)
            for spine in axes.spines.values():
                spine.set(visible=True, color="#cccccc")
        line[0].set_ylabel(label, fontsize=9)
    meanings |= {name: COLOURS[name] for name in ("on top of it", "cannot move")}
    handles = [Patch(fc=colour, label=meaning) for meaning, colour in meanings.items()]
    figure.legend(handles=handles, loc="outside upper center", ncols=len(handles), fontsize=9)
    return figure


def _draw_boxes(axes: Axes, sizes: np.ndarray, pose: np.ndarray, chosen) -> None:
    corners = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])
    for box, (size, (y, z, angle)) in enumerate(zip(sizes, pose)):
        turn = np.array([(np.cos(angle), np.sin(angle)), (-np.sin(angle), np.cos(angle))])
        colour = (chosen, COLOURS["on top of it"], COLOURS["cannot move"])[min(box, 2)]
        axes.add_patch(Polygon(corners * size @ turn + (y, z), fc=colour, ec="white", lw=0.8))


@styled
def agreement_scatter(frame: pd.DataFrame) -> Figure:
    """How far the same boxes move in ``table`` and ``local``, and in ``full`` and ``local``.

    Args:
        frame: see ``read_agreement``.
    """
    threshold, low, high = task.LIFT_THRESHOLD, -0.02, 0.5
    figure, panels = plt.subplots(1, 2, figsize=(10, 5), sharex=True, sharey=True)
    for axes, physics in zip(panels, ("table", "full")):
        axes.axline((0, 0), slope=1, color="#bbbbbb", lw=1, zorder=0)
        for corner in ((low, threshold), (threshold, low)):
            width, height = (threshold - low, high - threshold)[:: 1 if corner[0] == low else -1]
            axes.add_patch(Rectangle(corner, width, height, fc="#f1f0ec", ec="#8f8f8c", ls="--"))
        axes.text(0.35, 0.09, "different decisions", color="0.4", fontsize=9, ha="center")
        known = frame[frame[physics].notna()]
        for count, (colour, label) in enumerate(
            (("C2", "nothing"), ("C0", "one box"), ("C1", "two boxes"), ("C4", "three or more"))
        ):
            of = known[np.minimum(known["on_top"], 3) == count]
            axes.scatter(of["local"], of[physics], s=14, alpha=0.6, color=colour, label=label)
        axes.set(xlim=(low, high), ylim=(low, high), title=f"{len(known):,} lifts", aspect="equal")
        axes.set(xlabel="distance moved in local (m)", ylabel=f"distance moved in {physics} (m)")
    panels[0].legend(title="on top of the box", loc="upper left")
    return figure
