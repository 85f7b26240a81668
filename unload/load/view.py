"""Interactive 3D views of a load with plotly, which work offline in JupyterLab."""

from collections.abc import Mapping

import numpy as np
import plotly.graph_objects as go

from unload import task
from unload.load.boxes import Load, check_load
from unload.load.colours import COLOURS, css
from unload.load.substacks import package_colour
from unload.support import checks

# The corners of a box, and the twelve triangles of its faces.
CORNERS = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
TRIANGLES = np.array(
    [
        (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
        (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3),
    ]
)  # fmt: skip
SEAM = 0.012  # m, boxes are drawn this much smaller so that one sees where they end
# Of groups whose names are not in COLOURS, in the order in which they are given.
OTHER_COLOURS = ((0.00, 0.45, 0.70), (0.90, 0.62, 0.00), (0.58, 0.40, 0.74), (0.0, 0.0, 0.0))


def view(
    load: Load,
    present: np.ndarray | None = None,
    groups: Mapping[str, np.ndarray] | None = None,
    height: int = 520,
) -> go.Figure:
    """A load as one mesh to turn and zoom; pointing at a box names it.

    Args:
        load: the boxes.
        present: (n,) bool, which of them to draw; all if None.
        groups: name → item numbers, for example ``{"failed": failed}``. Each group
            has a line in the legend, and its name's colour in ``COLOURS`` or one of four
            others; of two groups that share an item the later one wins; items in no group
            have the colour of "unseen". If None, colours mean packages.
        height: of the figure in pixels.

    Raises:
        TypeError: ``load`` is not a ``Load``, ``groups`` no dict, or a group does not hold
            integers.
        ValueError: ``present`` has another shape, more than four groups have names that are
            not in ``COLOURS``, or a group holds a number that is no item.
    """
    check_load(load)
    present = np.ones(len(load), dtype=bool) if present is None else np.asarray(present)
    if present.shape != (len(load),) or present.dtype != bool:
        raise ValueError(
            f"present has shape {present.shape} and dtype {present.dtype}; "
            f"expected ({len(load)},) bool"
        )
    if groups is None:
        colours = np.array([package_colour(package) for package in load.packages])
        legend = {
            f"package {package}": package_colour(package)
            for package in np.unique(load.packages[present]).tolist()
        }
    else:
        colours, legend = _group_colours(len(load), groups)
    items = np.flatnonzero(present)
    figure = go.Figure(_mesh(load, items, colours[items]))
    for name, colour in legend.items():
        figure.add_trace(
            go.Scatter3d(
                x=[None], y=[None], z=[None], mode="markers", name=name,
                marker={"size": 8, "symbol": "square", "color": css(colour)},
            )
        )  # fmt: skip
    length, width, top = task.CONTAINER
    figure.update_layout(
        height=height,
        margin={"l": 0, "r": 0, "t": 0, "b": 0},
        legend={"x": 0, "y": 1},
        scene={
            "aspectmode": "data",
            "xaxis": {"title": "x (m)", "range": [0, length]},
            "yaxis": {"title": "y (m)", "range": [0, width]},
            "zaxis": {"title": "z (m)", "range": [0, top]},
            "camera": {"eye": {"x": 1.9, "y": -1.3, "z": 0.85}},
        },
    )
    return figure


def _group_colours(count: int, groups: Mapping[str, np.ndarray]) -> tuple[np.ndarray, dict]:
    checks.entries("groups", groups, ())
    others = [name for name in groups if name not in COLOURS]
    if len(others) > len(OTHER_COLOURS):
        raise ValueError(
            f"groups has the names {others}; expected at most {len(OTHER_COLOURS)} "
            f"besides {list(COLOURS)}"
        )
    named = COLOURS | dict(zip(others, OTHER_COLOURS))
    colours, legend = np.tile(COLOURS["unseen"], (count, 1)), {}
    for name, items in groups.items():
        items = np.asarray(items)
        legend[name] = named[name]
        if not items.size:
            continue
        if items.dtype.kind not in "iu":
            raise TypeError(f"groups[{name!r}] has dtype {items.dtype}; expected item numbers")
        if not (0 <= items.min() and items.max() < count):
            raise ValueError(
                f"groups[{name!r}] holds {items.min()} to {items.max()}; expected 0 to {count - 1}"
            )
        colours[items] = named[name]
    return colours, legend


def _mesh(load: Load, items: np.ndarray, colours: np.ndarray) -> go.Mesh3d:
    sizes = np.maximum(load.sizes - SEAM, load.sizes / 2)[items, None]
    vertices = load.positions[items, None] + CORNERS * sizes
    triangles = (TRIANGLES + np.arange(len(items))[:, None, None] * len(CORNERS)).reshape(-1, 3)
    labels = [f"item {item}, package {load.packages[item]}" for item in items]
    return go.Mesh3d(
        **dict(zip("xyz", vertices.reshape(-1, 3).round(3).T)),
        **dict(zip("ijk", triangles.T)),
        facecolor=np.repeat([css(colour) for colour in colours], len(TRIANGLES)),
        text=np.repeat(labels, len(CORNERS)),
        hoverinfo="text",
        flatshading=True,
        lighting={"ambient": 0.75, "diffuse": 0.5},
        showscale=False,
    )
