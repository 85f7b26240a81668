"""The drawing of a container whose boxes can be clicked, as a Jupyter widget.

It is not plotly's ``FigureWidget``, because that takes the press of a button for a click, so that
whoever turns the container picks boxes; because it sends 5 MB of JavaScript for each figure; and
because each pick sends the colours of all triangles. Here a pick is a message of a kilobyte.
"""

from collections.abc import Mapping
from pathlib import Path

import anywidget
import numpy as np
import traitlets

from unload import task
from unload.drawing.picture import TARGET
from unload.load.boxes import Load

ABSENT = 255  # colour number of a box that is not drawn
Colour = tuple[float, float, float]


class Canvas(anywidget.AnyWidget):
    """Boxes of a load, which can be turned by dragging, zoomed by the wheel, and clicked.

    ``on_msg`` hears of clicks: ``{"item": number}``.

    Args:
        load: the boxes.
    """

    _esm = Path(__file__).with_name("canvas.js")
    boxes = traitlets.Bytes().tag(sync=True)  # (n, 6) float32: lower and upper corners in m
    labels = traitlets.List().tag(sync=True)  # what is shown where the pointer is
    container = traitlets.List().tag(sync=True)
    target = traitlets.List().tag(sync=True)  # what the camera looks at
    height = traitlets.Int(480).tag(sync=True)
    palette = traitlets.List().tag(sync=True)  # RGB in [0, 1]
    colours = traitlets.Bytes().tag(sync=True)  # (n,) uint8: numbers in the palette, or ABSENT
    outlined = traitlets.List().tag(sync=True)  # items
    legend = traitlets.List().tag(sync=True)  # name, RGB, whether outlined
    lift = traitlets.Dict().tag(sync=True)  # item, distance in m, colour; number to tell them apart

    def __init__(self, load: Load) -> None:
        corners = np.hstack([load.positions - load.sizes / 2, load.positions + load.sizes / 2])
        edges = np.rint(load.sizes * 1000).astype(int)
        super().__init__(
            boxes=corners.astype(np.float32).tobytes(),
            labels=[
                f"item {item}, package {package}: {x} × {y} × {z} mm"
                for item, (package, (x, y, z)) in enumerate(zip(load.packages, edges))
            ],
            container=task.CONTAINER.tolist(),
            target=TARGET.tolist(),
            colours=np.zeros(len(load), np.uint8).tobytes(),
            palette=[(0.9, 0.9, 0.9)],
        )
        self._lifts = 0

    def show(
        self,
        numbers: np.ndarray,
        palette: Mapping[str, Colour],
        outlined: Mapping[str, np.ndarray],
        lifted: tuple[int, float, Colour] | None = None,
    ) -> None:
        """Colour the boxes, in one message.

        Args:
            numbers: (n,) int, of each box's colour in the palette, ``ABSENT`` if it is not there.
            palette: name → RGB. The names of those that occur stand in the legend.
            outlined: name → items with a thick outline. So do the names of those with items.
            lifted: an item that is seen to rise, how far in m, and its colour.
        """
        occur = np.isin(np.arange(len(palette)), numbers)
        legend = [(*line, False) for line, shown in zip(palette.items(), occur) if shown]
        boxes = {name: [int(item) for item in items] for name, items in outlined.items()}
        with self.hold_sync():  # so that all that has changed is one message
            self.colours = np.asarray(numbers, np.uint8).tobytes()
            self.palette = [tuple(colour) for colour in palette.values()]
            self.outlined = sum(boxes.values(), [])
            self.legend = legend + [
                (name, (1.0, 1.0, 1.0), True) for name, items in boxes.items() if items
            ]
            if lifted is not None:
                self._lifts += 1
                item, distance, colour = lifted
                self.lift = {
                    "item": int(item),
                    "distance": float(distance),
                    "colour": colour,
                    "number": self._lifts,
                }
