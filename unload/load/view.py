"""A load to turn and zoom in 3D, with plotly, which works offline in JupyterLab."""

import base64
import json
from collections.abc import Callable, Mapping, Sequence

import numpy as np
import plotly.graph_objects as go
from matplotlib import colormaps

from unload import task
from unload.load.boxes import Load, check_load
from unload.load.picture import COLOURS, CORNERS, EYE, SEAM, TARGET, corners, still
from unload.load.substacks import package_colour
from unload.support import checks

# The twelve triangles of a box's faces.
TRIANGLES = np.array(
    [
        (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
        (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3),
    ]
)  # fmt: skip
# Of groups whose names are not in COLOURS, in the order in which they are given.
OTHER_COLOURS = ((0.58, 0.40, 0.74), (0.90, 0.62, 0.00), (0.55, 0.34, 0.16), (0.0, 0.0, 0.0))
FIRST_PICKS = 10  # that a view of an order shows
PICK_COLOURS = tuple(
    map(tuple, colormaps["viridis"](np.linspace(0, 1, FIRST_PICKS))[:, :3].tolist())
)
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
        args, kwargs: of ``plotly.graph_objects.Figure``.
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
    order: np.ndarray | None = None,
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
        order: (k,) item numbers in the order in which they are picked, such as the column
            ``item`` of ``unload.picking_order``: the first ten have colours from dark to light.

    Returns:
        A plotly figure, which a notebook shows; elsewhere its method ``show`` does.

    Raises:
        TypeError: ``load`` is not a ``Load``, ``groups`` no dict, or a group does not hold
            integers.
        ValueError: ``present`` has another shape, more than four groups have names that are
            not in ``COLOURS``, a group or ``order`` holds a number that is no item, or both
            ``groups`` and ``order`` are given.
    """
    check_load(load)
    present = np.ones(len(load), dtype=bool) if present is None else np.asarray(present)
    if present.shape != (len(load),) or present.dtype != bool:
        raise ValueError(
            f"present has shape {present.shape} and dtype {present.dtype}; "
            f"expected ({len(load)},) bool"
        )
    height = checks.integer("height", height, 50, 5000)

    # Packages and picks are groups, too, in colours of their own.
    if order is not None:
        if groups is not None:
            raise ValueError("groups and order are given; expected one of them")
        items = _items("order", order, len(load))[:FIRST_PICKS]
        picks = range(1, len(items) + 1)
        groups = {f"pick {number}": items[number - 1 : number] for number in picks}
        of_item, names = _grouped(present, groups, PICK_COLOURS)
        names = {name.replace("unseen", "picked later"): names[name] for name in names}
    elif groups is None:
        packages = np.unique(load.packages[present]).tolist()
        groups = {f"package {p}": np.flatnonzero(load.packages == p) for p in packages}
        of_item, names = _grouped(present, groups, [package_colour(p) for p in packages])
    else:
        of_item, names = _grouped(present, groups, OTHER_COLOURS)
    traces = [
        mesh(load, np.flatnonzero(present & (of_item == number)), name, colour, legend=True)
        for number, (name, colour) in enumerate(names.items())
    ]

    # The still picture is drawn when the figure is displayed, if it is at all.
    drawn = np.flatnonzero(present)
    palette = np.array([*names.values(), (0, 0, 0)])

    def picture() -> bytes:
        return still(*corners(load, drawn), palette[of_item[drawn]], names, height / 100)

    return View(traces, layout(height), picture=picture)


def _grouped(
    present: np.ndarray,
    groups: Mapping[str, np.ndarray],
    colours: Sequence[tuple[float, float, float]],
) -> tuple[np.ndarray, dict]:
    """The number of each item's group, (n,) int, and the colours of all groups by name.

    Args:
        present, groups: see ``view``.
        colours: of the groups whose names are not in ``COLOURS``.
    """
    checks.entries("groups", groups, ())
    count = len(present)
    others = [name for name in groups if name not in COLOURS]
    if len(others) > len(colours):
        raise ValueError(
            f"groups has the names {others}; expected at most {len(colours)} "
            f"besides {list(COLOURS)}"
        )
    named = COLOURS | dict(zip(others, colours))

    # Of two groups that share an item the later one wins; a last group holds the rest.
    of_item, names = np.full(count, -1), list(groups)
    for number, (name, items) in enumerate(groups.items()):
        of_item[_items(f"groups[{name!r}]", items, count)] = number
    if (present & (of_item < 0)).any():
        if "unseen" not in names:
            names.append("unseen")
        of_item[of_item < 0] = names.index("unseen")
    return of_item, {name: named[name] for name in names}


def _items(name: str, items: object, count: int) -> np.ndarray:
    """Return ``items`` as an int64 array; raise unless it holds numbers of the ``count`` items."""
    items = checks.integer_array(name, items, (None,))
    if items.size and not (0 <= items.min() and items.max() < count):
        raise ValueError(f"{name} holds {items.min()} to {items.max()}; expected 0 to {count - 1}")
    return items


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
    # plotly measures the camera from the middle of the scene.
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


def css(colour: tuple[float, float, float]) -> str:
    """Return a colour of three numbers in [0, 1] as CSS and plotly write it."""
    return "rgb({:.0f},{:.0f},{:.0f})".format(*(255 * value for value in colour))
