"""A lift as a sequence of positions, seen from the entrance."""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from unload import checks
from unload.figures.style import styled

CHOSEN, ON_TOP, FIXED = "#2878b5", "#de5638", "#d9d9d6"


@styled
def lift_sequences(
    lifts: Mapping[str, tuple[np.ndarray, np.ndarray]],
    times: Sequence[float],
    dynamic: int = 2,
) -> Figure:
    """One line of pictures for each lift: chosen box blue, boxes on top of it orange.

    Args:
        lifts: label → (sizes, poses) of a situation's boxes, the chosen one first and
            those on top next. ``sizes`` is (boxes, 2) float, width and height in m;
            ``poses`` (times, boxes, 3) float, y and z of the centre in m and the angle
            of rotation about the x axis in rad.
        times: when the poses were taken, s.
        dynamic: how many of the boxes move; the others are grey.

    Raises:
        TypeError, ValueError: an argument is not as described, or there is nothing to draw.
    """
    checks.entries("lifts", lifts, ())
    times = checks.finite_array("times", times, (None,))
    if not lifts or not len(times):
        raise ValueError(
            f"lifts has {len(lifts)} and times {len(times)} entries; expected at least one each"
        )
    for label, (sizes, poses) in lifts.items():
        boxes = len(checks.finite_array(f"sizes of {label!r}", sizes, (None, 2)))
        checks.finite_array(f"poses of {label!r}", poses, (len(times), boxes, 3))
        checks.integer("dynamic", dynamic, 1, boxes)
    figure, grid = plt.subplots(
        len(lifts), len(times), figsize=(10, 2.05 * len(lifts)), squeeze=False
    )
    for line, (label, (sizes, poses)) in zip(grid, lifts.items()):
        limits = _limits(sizes[:dynamic], poses[:, :dynamic])
        for axes, time, pose in zip(line, times, poses):
            _draw_boxes(axes, sizes, pose, dynamic)
            axes.set(xlim=limits[0], ylim=limits[1], aspect="equal", xticks=[], yticks=[])
            axes.set_title(f"{time:.2f} s", fontsize=8)
            for spine in axes.spines.values():
                spine.set(visible=True, color="#cccccc")
        line[0].set_ylabel(label, fontsize=9)
    return figure


def _limits(sizes: np.ndarray, poses: np.ndarray) -> tuple[tuple, tuple]:
    """Limits of both axes that show all moving boxes at all times, and some room."""
    reach = np.hypot(*sizes.T)[:, None] / 2
    low, high = (poses[..., :2] - reach).min((0, 1)), (poses[..., :2] + reach).max((0, 1))
    return (low[0], high[0]), (low[1], high[1])


def _draw_boxes(axes: Axes, sizes: np.ndarray, pose: np.ndarray, dynamic: int) -> None:
    corners = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])
    for box, (size, (y, z, angle)) in enumerate(zip(sizes, pose)):
        turn = np.array([(np.cos(angle), np.sin(angle)), (-np.sin(angle), np.cos(angle))])
        colour = FIXED if box >= dynamic else CHOSEN if box == 0 else ON_TOP
        axes.add_patch(Polygon(corners * size @ turn + (y, z), fc=colour, ec="white", lw=0.8))
