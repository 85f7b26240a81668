"""Heaps in three dimensions: still, to turn, and as episodes with a slider."""

import io
from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import plotly.graph_objects as go
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from PIL import Image

from unload import task
from unload.heap.boxes import FARTHEST_EDGE, REAR, WIDTH, Heap
from unload.heap.rake import Outcome
from unload.load.colours import COLOURS, css
from unload.load.slider import buttons, slider
from unload.load.still import CORNERS, EYE, project
from unload.load.view import SEAM, TRIANGLES, UNIT, View, layout
from unload.reproduce.figures.style import STYLE, styled
from unload.support import checks

# What happens to a box in a pick, and its colour. The later ones win.
MEANINGS = {
    "stays": COLOURS["unseen"],
    "comes along": COLOURS["liftable"],
    "falls": COLOURS["failed"],
    "is dragged": COLOURS["tried"],
}
OUTSIDE = FARTHEST_EDGE + 0.6  # m, how far the pictures reach
FACES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
LIGHT = np.array([0.55, -0.45, 0.7]) / np.linalg.norm([0.55, -0.45, 0.7])
PAUSE = 900  # ms between two picks while a replay plays
MM = 1000  # a replay's coordinates are whole millimetres, in half of the bytes
PALETTE = 128  # colours of a still


def corners(heap: Heap) -> np.ndarray:
    """(n, 8, 3) float64, m: corners of the boxes as they are drawn, a little smaller."""
    own = (CORNERS - 0.5) * np.maximum(heap.sizes - SEAM, heap.sizes / 2)[:, None]
    return heap.positions[:, None] + own @ heap.axes().transpose(0, 2, 1)


def meanings(outcome: Outcome, box: int) -> np.ndarray:
    """(n,) int, the number in ``MEANINGS`` of what a pick does to each box before it."""
    numbers = np.zeros(len(outcome.unloaded), int)
    numbers[outcome.unloaded] = 1
    numbers[outcome.fallen] = 2
    numbers[box] = 3
    return numbers


def colours_of(numbers: np.ndarray) -> np.ndarray:
    """(n, 3) float, the colours of meanings that are given by their places in ``MEANINGS``."""
    return np.array(list(MEANINGS.values()))[numbers]


def draw_heap(axes: Axes, heap: Heap, colours: np.ndarray, title: str = "") -> None:
    """Draw a heap as seen from outside the door, the conveyor's edge as a line on the floor.

    Args:
        axes: where.
        heap: the boxes.
        colours: (n, 3) float in [0, 1], red, green and blue of each box.
        title: of the picture.
    """
    for line in _room(heap.edge()):
        axes.plot(*project(line).T, color="0.6", lw=0.8, zorder=0)
    faces = corners(heap)[:, FACES].reshape(-1, 4, 3)
    normals = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    # Away from the box's own centre, whichever way round its corners are listed.
    middle = faces.mean(axis=1)
    outward = middle - np.repeat(heap.positions, len(FACES), axis=0)
    normals *= np.sign((normals * outward).sum(axis=1))[:, None]
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-12)[:, None]
    towards = ((EYE - middle) * normals).sum(axis=1) > 0
    order = np.argsort(-np.linalg.norm(middle - EYE, axis=1), kind="stable")
    order = order[towards[order]]
    shade = 0.72 + 0.28 * (normals[order] @ LIGHT)
    colours = np.repeat(colours, len(FACES), axis=0)[order] * shade[:, None]
    axes.add_collection(
        PolyCollection(
            project(faces[order]),
            facecolors=np.clip(colours, 0, 1),
            edgecolors=0.5 * np.clip(colours, 0, 1),
            linewidths=0.4,
        )
    )
    frame = project(
        np.array([(x, y, z) for x in (REAR, OUTSIDE) for y in (0, WIDTH) for z in (0, 2.3)])
    )
    axes.set(
        aspect="equal",
        xlim=(frame[:, 0].min(), frame[:, 0].max()),
        ylim=(frame[:, 1].min(), frame[:, 1].max()),
        title=title,
    )
    axes.axis("off")


def _room(edge: float) -> list[np.ndarray]:
    """Lines (2, 3): the floor's outline, the rear wall's, and the conveyor's edge."""
    rear = [(REAR, 0, 0), (REAR, WIDTH, 0), (REAR, WIDTH, 2.3), (REAR, 0, 2.3)]
    lines = list(zip(rear, rear[1:] + rear[:1]))
    lines += [((REAR, y, 0), (OUTSIDE, y, 0)) for y in (0, WIDTH)]
    return [np.array(line) for line in (*lines, ((edge, 0, 0), (edge, WIDTH, 0)))]


def _add_legend(figure: Figure) -> None:
    handles = [Patch(facecolor=c, edgecolor="0.5", label=name) for name, c in MEANINGS.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(MEANINGS), frameon=False)


@styled
def one_pick(before: Heap, box: int, outcome: Outcome) -> Figure:
    """A heap before a pick, coloured by what the pick will do, and after it.

    Args:
        before: the heap.
        box: that is dragged.
        outcome: of the pick.
    """
    numbers = meanings(outcome, box)
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8))
    draw_heap(left, before, colours_of(numbers), "before the pick")
    kept = numbers[outcome.left]
    kept[kept == 1] = 0
    count, falls = int(outcome.unloaded.sum()), int(outcome.fallen.sum())
    draw_heap(right, outcome.heap, colours_of(kept), f"after it: {count} unloaded, {falls} fallen")
    _add_legend(figure)
    return figure


@styled
def foretold(
    before: Heap, box: int, visible: np.ndarray, chances: np.ndarray, outcome: Outcome
) -> Figure:
    """What a network expects of each visible box when one is dragged, and what happens.

    Args:
        before: the heap.
        box: that is dragged.
        visible: (m,) int, the numbers of the visible boxes.
        chances: (m, 2) float, probabilities that each of them is unloaded, and that it falls:
            the share of these colours in the box's own.
        outcome: of the pick.
    """
    stays, comes, falls, dragged = colours_of(np.arange(len(MEANINGS)))
    share = chances / np.maximum(chances.sum(axis=1, keepdims=True), 1)
    colours = np.tile(stays, (len(before), 1))
    colours[visible] += share[:, :1] * (comes - stays) + share[:, 1:] * (falls - stays)
    colours[box] = dragged
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8))
    draw_heap(left, before, colours, "foretold")
    draw_heap(right, before, colours_of(meanings(outcome, box)), "what happens")
    _add_legend(figure)
    return figure


def view_heap(heap: Heap, numbers: np.ndarray | None = None, height: int = 460) -> View:
    """A heap to turn and zoom.

    Args:
        heap: the boxes.
        numbers: (n,) int, the meaning of each, a place in ``MEANINGS``; all "stays" if None.
        height: of the figure in pixels, 200 to 5000.

    Raises:
        TypeError, ValueError: an argument is not as described.
    """
    if not isinstance(heap, Heap):
        raise TypeError(f"heap is {heap!r}; expected a Heap")
    height = checks.integer("height", height, 200, 5000)
    numbers = np.zeros(len(heap), int) if numbers is None else numbers
    numbers = checks.integer_array("numbers", numbers, (len(heap),))
    return View(
        [_mesh(corners(heap), numbers), *_legend_traces()],
        _layout(height),
        picture=lambda: _still({"": (heap, numbers)}),
    )


class Played:
    """An episode as it is drawn: where each box of the first heap is before each pick.

    Args:
        heaps: before each pick and after the last, t + 1.
        boxes: (t,) int, dragged ones, by their numbers in the heap before.
        outcomes: of the t picks.
    """

    def __init__(
        self, heaps: Sequence[Heap], boxes: np.ndarray, outcomes: Sequence[Outcome]
    ) -> None:
        if len(heaps) != len(outcomes) + 1 or len(boxes) != len(outcomes):
            raise ValueError(
                f"heaps, boxes and outcomes are {len(heaps)}, {len(boxes)} and {len(outcomes)}; "
                "expected one heap more than picks"
            )
        self.heaps = list(heaps)
        nothing = np.zeros(len(heaps[-1]), int)
        self.meanings = [meanings(o, int(b)) for o, b in zip(outcomes, boxes)] + [nothing]
        self.unloaded = np.cumsum([0, *(int(one.unloaded.sum()) for one in outcomes)])
        self.falls = np.cumsum([0, *(int(one.fallen.sum()) for one in outcomes)])
        self._numbers = [np.arange(len(heaps[0]))]
        for one in outcomes:
            self._numbers.append(self._numbers[-1][one.left])

    def title(self, name: str, pick: int) -> str:
        """What has happened before a pick."""
        pick = min(pick, len(self.meanings) - 1)
        return f"{name}: {self.unloaded[pick]} unloaded, {self.falls[pick]} fallen"

    def state(self, pick: int) -> tuple[np.ndarray, np.ndarray]:
        """Corners (n, 8, 3) and meanings (n,) of the first heap's boxes before a pick.

        The corners of those that are gone are all the same, so that nothing of them is seen.
        """
        pick = min(pick, len(self.meanings) - 1)
        places = np.broadcast_to((REAR, 0.0, 0.0), (len(self.heaps[0]), 8, 3)).copy()
        places[self._numbers[pick]] = corners(self.heaps[pick])
        numbers = np.zeros(len(self.heaps[0]), int)
        numbers[self._numbers[pick]] = self.meanings[pick]
        return places, numbers


def replay_heaps(episodes: Mapping[str, Played], height: int = 460) -> View:
    """Episodes side by side, with a slider over their picks and a play button; no kernel.

    Each stop shows the heaps before a pick, coloured by what the pick will do. Where plotly is
    not drawn, there is a picture of the middle stop.

    Args:
        episodes: title → episode, from left to right, one to three.
        height: of the figure in pixels, 200 to 5000.

    Raises:
        TypeError, ValueError: an argument is not as described.
    """
    checks.entries("episodes", episodes, ())
    checks.integer("len(episodes)", len(episodes), 1, 3)
    height = checks.integer("height", height, 200, 5000)
    stops = range(max(len(each.meanings) for each in episodes.values()))  # the last: the end
    traces, scenes, titles = [], {}, []
    for place, (name, played) in enumerate(episodes.items()):
        scene = f"scene{place + 1}" if place else "scene"
        traces.append(_mesh(*played.state(0), MM).update(scene=scene))
        width = 1 / len(episodes)
        domain = {"x": [place * width, (place + 1) * width], "y": [0.1, 1]}
        scenes[scene] = _layout(height, MM).scene.update(domain=domain)
        titles.append({
            "x": (place + 0.5) * width, "y": 1, "xref": "paper", "yref": "paper",
            "xanchor": "center", "showarrow": False, "text": played.title(name, 0),
        })  # fmt: skip
    frames = [
        go.Frame(
            name=str(stop),
            data=[_moved(*played.state(stop), MM) for played in episodes.values()],
            traces=list(range(len(traces))),
            layout={
                "annotations": [
                    {**title, "text": played.title(name, stop)}
                    for title, (name, played) in zip(titles, episodes.items())
                ]
            },
        )
        for stop in stops
    ]
    middle = len(stops) // 2

    def picture() -> bytes:
        last = {name: min(middle, len(each.heaps) - 1) for name, each in episodes.items()}
        return _still(
            {
                each.title(name, last[name]): (each.heaps[last[name]], each.meanings[last[name]])
                for name, each in episodes.items()
            }
        )

    figure = View([*traces, *_legend_traces()], _layout(height), frames, picture=picture)
    labels = {str(stop): f"pick {stop + 1}" for stop in stops}
    figure.update_layout(
        **scenes, annotations=titles, sliders=[slider(labels)], updatemenus=[buttons(PAUSE)]
    )
    return figure


def _mesh(places: np.ndarray, numbers: np.ndarray, unit: int = 1) -> go.Mesh3d:
    """Boxes with given corners (m), one colour for each meaning; ``unit`` is drawn as 1 m."""
    triangles = TRIANGLES + np.arange(len(places))[:, None, None] * len(CORNERS)
    steps = np.linspace(0, 1, len(MEANINGS) + 1)
    scale = [
        (float(end), css(colour))
        for colour, *ends in zip(MEANINGS.values(), steps, steps[1:])
        for end in ends
    ]
    return go.Mesh3d(
        **dict(zip("ijk", triangles.reshape(-1, 3).astype(np.int16).T)),
        intensitymode="cell",
        colorscale=scale,
        cmin=-0.5,
        cmax=len(MEANINGS) - 0.5,
        showscale=False,
        hoverinfo="skip",
        flatshading=True,
        lighting={"ambient": 0.7, "diffuse": 0.5, "specular": 0.0},
        **_moved(places, numbers, unit),
    )


def _moved(places: np.ndarray, numbers: np.ndarray, unit: int = 1) -> dict:
    """What a frame changes of a mesh."""
    points = unit * places.reshape(-1, 3)
    points = points.astype(np.float32) if unit == 1 else np.rint(points).astype(np.int16)
    coordinates = dict(zip("xyz", points.T))
    cells = np.repeat(numbers, len(TRIANGLES)).astype(np.int8)
    return {"type": "mesh3d", **coordinates, "intensity": cells}


def _legend_traces() -> list[go.Scatter3d]:
    """A line of the legend for each meaning, which a mesh of several colours cannot give."""
    return [
        go.Scatter3d(
            x=[None], y=[None], z=[None], mode="markers", name=name,
            marker={"symbol": "square", "size": 9, "color": css(colour)},
        )
        for name, colour in MEANINGS.items()
    ]  # fmt: skip


def _layout(height: int, unit: int = 1) -> go.Layout:
    """The last metres of the container, in true proportions; lengths only if in metres."""
    made = layout(height)
    low, high = np.array([REAR, 0, 0]), np.array([OUTSIDE, WIDTH, task.CONTAINER[2]])
    middle = (low + high) / 2
    for axis, *ends in zip("xyz", unit * low, unit * high):
        made.scene[f"{axis}axis"].update(range=ends)
        if unit != 1:
            made.scene[f"{axis}axis"].update(showticklabels=False, title={"text": ""})
    made.scene.update(
        aspectratio=dict(zip("xyz", (high - low) / UNIT)),
        camera={
            "eye": dict(zip("xyz", 0.78 * (EYE - middle) / UNIT)),
            "center": {"x": 0, "y": 0, "z": -0.1},
        },
    )
    return made


def _still(states: Mapping[str, tuple[Heap, np.ndarray]]) -> bytes:
    """A PNG file of heaps side by side."""
    with plt.style.context(STYLE):
        figure = Figure((4.5 * max(2, len(states)), 4.0), dpi=100, facecolor="white")
        for axes, (title, (heap, numbers)) in zip(
            np.ravel(figure.subplots(1, len(states))), states.items()
        ):
            draw_heap(axes, heap, colours_of(numbers), title)
        _add_legend(figure)
        file = io.BytesIO()
        figure.savefig(file, format="png", dpi=100, metadata={"Software": None})
    small = io.BytesIO()
    # By octree: the few coloured pixels among many grey ones keep their colours.
    picture = Image.open(file).convert("RGB").quantize(PALETTE, Image.Quantize.FASTOCTREE)
    picture.save(small, "PNG", optimize=True)  # a third of the bytes
    return small.getvalue()
