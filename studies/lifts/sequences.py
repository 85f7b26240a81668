"""Lifts as sequences of pictures, seen from the entrance."""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Polygon

from studies.style import styled
from unload import task
from unload.load.picture import COLOURS


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
