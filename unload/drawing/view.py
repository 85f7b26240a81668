"""A load to turn and zoom in 3D, with plotly, which works offline in JupyterLab."""

import base64
import json
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
import plotly.graph_objects as go
from matplotlib import colormaps
from matplotlib.colors import to_hex
from plotly.io import renderers

from unload import task
from unload.drawing import picture
from unload.load.boxes import Load, check_load
from unload.support import checks

# Of groups whose names are not in COLOURS, in the order in which they are given.
_OTHER_COLOURS = ((0.58, 0.40, 0.74), (0.90, 0.62, 0.00), (0.55, 0.34, 0.16), (0.0, 0.0, 0.0))
_FIRST_PICKS = 10  # that a view of an order shows
_PICK_COLOURS = colormaps["viridis"](np.linspace(0, 1, _FIRST_PICKS))[:, :3].tolist()
_PLOTLY_MIMETYPE = "application/vnd.plotly.v1+json"
_UNITS_LONG = 2.8  # how long a container is in plotly's unit of length in our views
_LABEL = (
    "item %{customdata[0]}, package %{customdata[1]}<br>"
    "%{customdata[2]} × %{customdata[3]} × %{customdata[4]} mm<extra>%{fullData.name}</extra>"
)


class View(go.Figure):
    """A plotly figure with a still picture of itself, for where plotly is not drawn.

    A notebook shows it. Elsewhere ``show()`` opens it in a browser, and ``write_html(path)`` makes
    a page of it, also where there is none.

    A code-hosting site, for example, shows the pictures in a notebook but runs no JavaScript.
    plotly draws its own still pictures in a browser, therefore ours come from elsewhere: they
    do not show what is added to the figure later.

    Attributes:
        picture: to be set; returns the PNG file when the figure is displayed. None: no picture.
    """

    picture: Callable[[], bytes] | None = None
    _ipython_display_ = None  # plotly's own method would display the figure alone
    _repr_html_ = None  # plotly's own method would load a script from the network

    def __repr__(self) -> str:
        return "View, which a notebook shows; elsewhere show() opens it, write_html(path) keeps it"

    def show(self, *args, **kwargs) -> None:
        """Show the view in a notebook or in a browser; RuntimeError if plotly finds neither."""
        if not (args or kwargs or renderers.default):
            wanted = "expected one of them, or write_html(path) instead of show()"
            raise RuntimeError(f"plotly finds no notebook and no browser here; {wanted}")
        super().show(*args, **kwargs)

    def _repr_mimebundle_(self, include=None, exclude=None, **kwargs) -> dict:
        bundle = {_PLOTLY_MIMETYPE: json.loads(self.to_json()), "text/plain": "View"}
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
        groups: name → item numbers, for example ``{"failed": failed}``. Each group has a line in
            the legend, and its name's colour in ``COLOURS`` or one of four others; of two groups
            that share an item the later one wins; items in no group have the colour of "unseen".
            If None, colours mean packages.
        height: of the figure in pixels.
        order: (k,) item numbers in the order in which they are picked, such as the column
            ``item`` of ``unload.picking_order``: the first ten have colours from dark to light.

    Returns:
        A plotly figure, which a notebook shows; a script calls its methods ``show()``, for a
        browser, or ``write_html(path)``.

    Raises:
        TypeError, ValueError: an argument is not as described, more than four groups have names
            that are not in ``COLOURS``, or both ``groups`` and ``order`` are given.
    """
    check_load(load)
    count = len(load)
    present = checks.flag_array("present", np.ones(count) if present is None else present, (count,))
    height = checks.integer("height", height, 50, 5000)

    # Packages and picks are groups, too, in colours of their own.
    colours: Sequence = _OTHER_COLOURS
    rest = "unseen"
    if order is not None:
        if groups is not None:
            raise ValueError("groups and order are given; expected one of them")
        first = checks.integer_array("order", order, (None,), count - 1)[:_FIRST_PICKS]
        groups = {f"pick {k + 1}": first[k : k + 1] for k in range(len(first))}
        colours, rest = _PICK_COLOURS, "picked later"
    elif groups is None:
        packages = np.unique(load.packages[present]).tolist()
        groups = {f"package {p}": np.flatnonzero(load.packages == p) for p in packages}
        colours = [picture.package_colour(package) for package in packages]
    checks.entries("groups", groups, ())
    others = [name for name in groups if name not in picture.COLOURS]
    if len(others) > len(colours):
        known = f"{len(colours)} besides {list(picture.COLOURS)}"
        raise ValueError(f"groups has the names {others}; expected at most {known}")
    named = {rest: picture.COLOURS["unseen"]} | picture.COLOURS | dict(zip(others, colours))

    # Of two groups that share an item the later one wins; a last group holds the rest.
    of_item, names = np.full(count, -1), list(groups)
    for number, (name, items) in enumerate(groups.items()):
        items = checks.integer_array(f"groups[{name!r}]", items, (None,), count - 1)
        of_item[items] = number
    if (present & (of_item < 0)).any():
        names += [rest] if rest not in names else []
        of_item[of_item < 0] = names.index(rest)
    legend = {name: named[name] for name in names}
    traces = [
        mesh(load, np.flatnonzero(present & (of_item == number)), name, colour, legend=True)
        for number, (name, colour) in enumerate(legend.items())
    ]

    # The still picture is drawn when the figure is displayed, if it is at all.
    figure, drawn = View(traces, layout(height, load.container)), np.flatnonzero(present)
    boxes = (
        *picture.corners(load, drawn),
        np.array([*legend.values()]).reshape(-1, 3)[of_item[drawn]],
    )
    figure.picture = partial(picture.still, *boxes, legend, height / 100, load.container)
    return figure


def mesh(
    load: Load,
    items: np.ndarray,
    name: str,
    colour: tuple[float, float, float],
    legend: bool,
    seam: float = picture.SEAM,
) -> go.Mesh3d:
    """Items of one colour, RGB in [0, 1], as a mesh of 8 vertices and 12 triangles each.

    Args:
        load, items: (k,) int, numbers of items in the load; may be empty.
        name, legend: of the group, in the label of a box; whether the legend names it, too.
        seam: by how much the drawing shrinks them, in m.
    """
    low, high = picture.corners(load, items, seam)
    vertices = low[:, None] + picture.CORNERS * (high - low)[:, None]
    triangles = picture.TRIANGLES + np.arange(len(items))[:, None, None] * len(picture.CORNERS)
    labels = np.column_stack([items, load.packages[items], np.rint(load.sizes[items] * 1000)])
    return go.Mesh3d(
        **dict(zip("xyz", vertices.reshape(-1, 3).astype(np.float32).T)),
        **dict(zip("ijk", _short(triangles.reshape(-1, 3)).T)),
        name=name,
        color=to_hex(colour),
        showlegend=legend,
        customdata=_short(np.repeat(labels, len(picture.CORNERS), axis=0)),
        hovertemplate=_LABEL,
        flatshading=True,
        lighting={"ambient": 0.75, "diffuse": 0.5},
    )


def _short(numbers: np.ndarray) -> np.ndarray:
    """Whole numbers in few bytes, because they are kept in notebooks."""
    return numbers.astype(np.int16 if numbers.max(initial=0) < 2**15 else np.int32)


def layout(height: int, container: np.ndarray = task.CONTAINER) -> go.Layout:
    """The container's axes in true proportions, seen from outside the entrance.

    A white ground, because the axes' names are dark in JupyterLab's dark theme, too.
    """
    # plotly measures the camera from the middle of the scene.
    places = {"eye": picture.EYE, "center": picture.TARGET}
    unit, scale = container[0] / _UNITS_LONG, container / task.CONTAINER
    camera = {name: (place * scale - container / 2) / unit for name, place in places.items()}
    scene = {
        f"{axis}axis": {"title": {"text": f"{axis} (m)"}, "range": [0, length], "nticks": 8}
        for axis, length in zip("xyz", container)
    }
    return go.Layout(
        height=height,
        margin={"l": 0, "r": 0, "t": 0, "b": 0},
        paper_bgcolor="white",
        legend={"x": 0, "y": 1, "itemsizing": "constant", "bgcolor": "rgba(255,255,255,0.8)"},
        showlegend=True,  # of a single group, too
        scene_aspectmode="manual",
        scene_aspectratio=dict(zip("xyz", container / unit)),
        scene_camera={name: dict(zip("xyz", place)) for name, place in camera.items()},
        scene=scene,
    )
