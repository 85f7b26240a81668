"""A load painted in perspective as ``unload.load.still`` draws it, but fast enough for a film."""

import numpy as np
from PIL import Image, ImageDraw

from unload import task
from unload.load.boxes import Load
from unload.load.still import CORNERS, FACES, back_to_front, project
from unload.load.view import corners

FINE = 3  # times finer is painted than shown, so that edges are smooth
EDGE = 0.7  # brightness of the edge of a face, as a share of that of the face
# The insides of the container that are seen: corners, and brightness of the grey.
INSIDES = (((0, 4, 6, 2), 0.91), ((0, 2, 3, 1), 0.94), ((2, 6, 7, 3), 0.87))


class Painter:
    """Paints the boxes of one load, each of them in one colour.

    Args:
        load: the boxes.
        size: width and height of the pictures in pixels.
        room: pixels kept free at the left, the upper, the right and the lower edge.
    """

    def __init__(self, load: Load, size: tuple[int, int], room: tuple[int, int, int, int]) -> None:
        self._size = size
        self._low, self._high = corners(load, np.arange(len(load)))
        self._order = back_to_front(self._low, self._high)
        self._container = project(CORNERS * task.CONTAINER)
        self._fit(room)

    def paint(
        self, present: np.ndarray, colours: np.ndarray, rise: np.ndarray, shown: list[int]
    ) -> Image.Image:
        """One picture.

        Args:
            present: (n,) bool, the boxes that are painted.
            colours: (n, 3) float, RGB in [0, 1].
            rise: (n,) float, how far above its place a box is painted, m.
            shown: boxes that are seen through all others.
        """
        image = Image.new("RGB", tuple(FINE * side for side in self._size), "white")
        draw = ImageDraw.Draw(image)
        inside = self._pixels(self._container)
        for face, brightness in INSIDES:
            draw.polygon(inside[list(face)].ravel().tolist(), (round(255 * brightness),) * 3)
        order = [*self._order[present[self._order]].tolist(), *shown]
        fills = np.rint(255 * colours[:, None] * [[brightness] for _, brightness in FACES])
        edges = np.rint(EDGE * fills).astype(int)
        fills = fills.astype(int)
        for item, box in zip(order, self._pixels(self._boxes(order, rise))):
            for (face, _), fill, edge in zip(FACES, fills[item], edges[item]):
                points = box[list(face)].ravel().tolist()
                draw.polygon(points, tuple(fill.tolist()), tuple(edge.tolist()))
        return image.resize(self._size, Image.Resampling.BOX)

    def _boxes(self, items: list[int], rise: np.ndarray) -> np.ndarray:
        """Where the corners of boxes are seen, (k, 8, 2)."""
        low, high = self._low[items, None], self._high[items, None]
        return project(low + CORNERS * (high - low) + rise[items, None, None] * [0, 0, 1])

    def _fit(self, room: tuple[int, int, int, int]) -> None:
        """Choose scale and shift such that the container fills what ``room`` leaves."""
        seen = self._container * [1, -1]  # pixels count downwards
        low, high = seen.min(axis=0), seen.max(axis=0)
        free = np.subtract(self._size, np.add(room[:2], room[2:]))
        self._scale = FINE * (free / (high - low)).min()
        self._shift = FINE * (room[:2] + free / 2) - self._scale * (low + high) / 2

    def _pixels(self, seen: np.ndarray) -> np.ndarray:
        return self._shift + self._scale * seen * [1, -1]
