"""Episodes with heaps, side by side, with a slider over their picks; they need no kernel."""

import io
from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import plotly.graph_objects as go
from matplotlib.figure import Figure
from PIL import Image

from unload import task
from unload.heap.boxes import REAR, WIDTH, Heap
from unload.heap.rake import Outcome
from unload.heap.study.figures import (
    MEANINGS,
    OUTSIDE,
    add_legend,
    colours_of,
    corners,
    draw_heap,
    meanings,
)
from unload.load.view import CORNERS, EYE, TRIANGLES, UNIT, View, buttons, css, layout, slider
from unload.reproduce.style import STYLE
from unload.support import checks

HEIGHT = 460  # pixels
PAUSE = 900  # ms between two picks while a replay plays
MM = 1000  # coordinates are whole millimetres, in half of the bytes
PALETTE = 128  # colours of a still


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


def replay_heaps(episodes: Mapping[str, Played]) -> View:
    """Episodes side by side, with a slider over their picks and a play button; no kernel.

    Each stop shows the heaps before a pick, coloured by what the pick will do. Where plotly is
    not drawn, there is a picture of the middle stop.

    Args:
        episodes: title → episode, from left to right, one to three.

    Raises:
        TypeError, ValueError: an argument is not as described.
    """
    checks.entries("episodes", episodes, ())
    checks.integer("len(episodes)", len(episodes), 1, 3)
    stops = range(max(len(each.meanings) for each in episodes.values()))  # the last: the end
    traces, scenes, titles = [], {}, []
    for place, (name, played) in enumerate(episodes.items()):
        scene = f"scene{place + 1}" if place else "scene"
        traces.append(_mesh(*played.state(0)).update(scene=scene))
        width = 1 / len(episodes)
        domain = {"x": [place * width, (place + 1) * width], "y": [0.1, 1]}
        scenes[scene] = _layout().scene.update(domain=domain)
        titles.append({
            "x": (place + 0.5) * width, "y": 1, "xref": "paper", "yref": "paper",
            "xanchor": "center", "showarrow": False, "text": played.title(name, 0),
        })  # fmt: skip
    frames = [
        go.Frame(
            name=str(stop),
            data=[_moved(*played.state(stop)) for played in episodes.values()],
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

    figure = View([*traces, *_legend_traces()], _layout(), frames, picture=picture)
    labels = {str(stop): f"pick {stop + 1}" for stop in stops}
    figure.update_layout(
        **scenes, annotations=titles, sliders=[slider(labels)], updatemenus=[buttons(PAUSE)]
    )
    return figure


def _mesh(places: np.ndarray, numbers: np.ndarray) -> go.Mesh3d:
    """Boxes with given corners (m), one colour for each meaning."""
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
        **_moved(places, numbers),
    )


def _moved(places: np.ndarray, numbers: np.ndarray) -> dict:
    """What a frame changes of a mesh."""
    points = np.rint(MM * places.reshape(-1, 3)).astype(np.int16)
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


def _layout() -> go.Layout:
    """The last metres of the container, in true proportions."""
    made = layout(HEIGHT)
    low, high = np.array([REAR, 0, 0]), np.array([OUTSIDE, WIDTH, task.CONTAINER[2]])
    middle = (low + high) / 2
    for axis, *ends in zip("xyz", MM * low, MM * high):
        made.scene[f"{axis}axis"].update(range=ends, showticklabels=False, title={"text": ""})
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
        add_legend(figure)
        file = io.BytesIO()
        figure.savefig(file, format="png", dpi=100, metadata={"Software": None})
    small = io.BytesIO()
    # By octree: the few coloured pixels among many grey ones keep their colours.
    picture = Image.open(file).convert("RGB").quantize(PALETTE, Image.Quantize.FASTOCTREE)
    picture.save(small, "PNG", optimize=True)  # a third of the bytes
    return small.getvalue()
