"""Interactive 3D views of a load with plotly, which work offline in JupyterLab."""

import base64
import json
from collections.abc import Callable, Mapping

import numpy as np
import plotly.graph_objects as go

from unload import task
from unload.load.boxes import Load, check_load
from unload.load.colours import COLOURS, css
from unload.load.still import CORNERS, EYE, TARGET, still
from unload.load.substacks import package_colour
from unload.support import checks

# The twelve triangles of a box's faces.
TRIANGLES = np.array(
    [
        (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
        (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3),
    ]
)  # fmt: skip
SEAM = 0.012  # m, boxes are drawn this much smaller so that one sees where they end
# Of groups whose names are not in COLOURS, in the order in which they are given.
OTHER_COLOURS = ((0.58, 0.40, 0.74), (0.90, 0.62, 0.00), (0.55, 0.34, 0.16), (0.0, 0.0, 0.0))
PLOTLY_MIMETYPE = "application/vnd.plotly.v1+json"
UNIT = task.CONTAINER[0] / 2.8  # m, plotly's unit of length in our views
LABEL = (
    "item %{customdata[0]}, package %{customdata[1]}<br>"
    "%{customdata[2]} × %{customdata[3]} × %{customdata[4]} mm<extra>%{fullData.name}</extra>"
)


class View(go.Figure):
    """A plotly figure with a still picture of itself, for where plotly is not drawn.

    A code-hosting site, for example, shows the pictures in a notebook but runs no JavaScript.
    plotly draws its own still pictures in a browser, therefore ours come from elsewhere: they
    do not show what is added to the figure later.

    Args:
        *args, **kwargs: of ``plotly.graph_objects.Figure``.
        picture: returns the PNG file; called when the figure is displayed. None: no picture.

    Attributes:
        picture: as given.
    """

    picture: Callable[[], bytes] | None = None
    _ipython_display_ = None  # plotly's own method would display the figure alone
    _repr_html_ = None  # plotly's own method would load a script from the network

    def __init__(self, *args, picture: Callable[[], bytes] | None = None, **kwargs) -> None:
        super().__init__(*args, **kwargs)
        self.picture = picture

    def _repr_mimebundle_(self, include=None, exclude=None, **kwargs) -> dict:
        bundle = {PLOTLY_MIMETYPE: json.loads(self.to_json()), "text/plain": "View"}
        if self.picture is not None:
            bundle["image/png"] = base64.b64encode(self.picture()).decode()
        return bundle


def view(
    load: Load,
    present: np.ndarray | None = None,
    groups: Mapping[str, np.ndarray] | None = None,
    height: int = 520,
) -> View:
    """A load to turn and zoom, in true proportions; pointing at a box says what it is.

    The entrance is at the right in front. A click on a line of the legend hides its boxes.

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
    height = checks.integer("height", height, 50, 5000)
    if groups is None:
        names = {f"package {p}": package_colour(p) for p in np.unique(load.packages[present])}
        numbers = np.unique(load.packages[present], return_inverse=True)[1]
        of_item = np.zeros(len(load), dtype=int)
        of_item[present] = numbers
    else:
        of_item, names = _grouped(present, groups)
    traces = [
        mesh(load, np.flatnonzero(present & (of_item == number)), name, colour, legend=True)
        for number, (name, colour) in enumerate(names.items())
    ]
    drawn = np.flatnonzero(present)
    palette = np.array([*names.values(), (0, 0, 0)])

    def picture() -> bytes:
        return still(*corners(load, drawn), palette[of_item[drawn]], names, height / 100)

    return View(traces, layout(height), picture=picture)


def _grouped(present: np.ndarray, groups: Mapping[str, np.ndarray]) -> tuple[np.ndarray, dict]:
    """The number of each item's group, (n,) int, and the colours of all groups by name."""
    checks.entries("groups", groups, ())
    count = len(present)
    others = [name for name in groups if name not in COLOURS]
    if len(others) > len(OTHER_COLOURS):
        raise ValueError(
            f"groups has the names {others}; expected at most {len(OTHER_COLOURS)} "
            f"besides {list(COLOURS)}"
        )
    named = COLOURS | dict(zip(others, OTHER_COLOURS))
    of_item, names = np.full(count, -1), list(groups)
    for number, (name, items) in enumerate(groups.items()):
        items = np.asarray(items)
        if not items.size:
            continue
        if items.dtype.kind not in "iu":
            raise TypeError(f"groups[{name!r}] has dtype {items.dtype}; expected item numbers")
        if not (0 <= items.min() and items.max() < count):
            raise ValueError(
                f"groups[{name!r}] holds {items.min()} to {items.max()}; expected 0 to {count - 1}"
            )
        of_item[items] = number
    if (present & (of_item < 0)).any():
        if "unseen" not in names:
            names.append("unseen")
        of_item[of_item < 0] = names.index("unseen")
    return of_item, {name: named[name] for name in names}


def corners(load: Load, items: np.ndarray, seam: float = SEAM) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corners of items as they are drawn, (k, 3) float64 each, in m."""
    centres = load.positions[items]
    halves = np.maximum(load.sizes - seam, load.sizes / 2)[items] / 2
    return centres - halves, centres + halves


def mesh(
    load: Load,
    items: np.ndarray,
    name: str,
    colour: tuple[float, float, float],
    legend: bool = False,
    seam: float = SEAM,
) -> go.Mesh3d:
    """Items of one colour as a mesh of 8 vertices and 12 triangles each.

    Args:
        load: holds the items.
        items: (k,) int, their numbers; may be empty.
        name: of the group, for the legend and the label of a box.
        colour: RGB in [0, 1].
        legend: whether the legend names them.
        seam: how much smaller than they are they are drawn, in m.
    """
    low, high = corners(load, items, seam)
    vertices = low[:, None] + CORNERS * (high - low)[:, None]
    triangles = TRIANGLES + np.arange(len(items))[:, None, None] * len(CORNERS)
    labels = np.column_stack([items, load.packages[items], np.rint(load.sizes[items] * 1000)])
    return go.Mesh3d(
        **dict(zip("xyz", vertices.reshape(-1, 3).astype(np.float32).T)),
        **dict(zip("ijk", _short(triangles.reshape(-1, 3)).T)),
        name=name,
        color=css(colour),
        showlegend=legend,
        customdata=_short(np.repeat(labels, len(CORNERS), axis=0)),
        hovertemplate=LABEL,
        flatshading=True,
        lighting={"ambient": 0.75, "diffuse": 0.5},
    )


def _short(numbers: np.ndarray) -> np.ndarray:
    """Whole numbers in few bytes, because they are kept in notebooks."""
    fits = numbers.max(initial=0) <= np.iinfo(np.int16).max
    return numbers.astype(np.int16 if fits else np.int32)


def layout(height: int) -> go.Layout:
    """The container's axes in true proportions, seen from outside the entrance.

    A white ground, because the axes' names are dark in JupyterLab's dark theme, too.

    Args:
        height: of the figure in pixels.
    """
    sides = {
        f"{axis}axis": {"title": {"text": f"{axis} (m)"}, "range": [0, length], "nticks": 8}
        for axis, length in zip("xyz", task.CONTAINER)
    }
    middle = task.CONTAINER / 2
    return go.Layout(
        height=height,
        margin={"l": 0, "r": 0, "t": 0, "b": 0},
        paper_bgcolor="white",
        legend={"x": 0, "y": 1, "itemsizing": "constant", "bgcolor": "rgba(255,255,255,0.8)"},
        showlegend=True,  # of a single group, too
        scene={
            "aspectmode": "manual",
            "aspectratio": dict(zip("xyz", task.CONTAINER / UNIT)),
            **sides,
            "camera": {
                "eye": dict(zip("xyz", (EYE - middle) / UNIT)),
                "center": dict(zip("xyz", (TARGET - middle) / UNIT)),
            },
        },
    )
