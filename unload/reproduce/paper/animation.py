"""The README's moving picture: agents unload the same load side by side."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib import get_data_path
from PIL import Image, ImageDraw, ImageFont

from unload import task
from unload.agent.evaluation import Policy
from unload.env import observation
from unload.env.container import ContainerEnv
from unload.load.boxes import Load
from unload.load.view import COLOURS, CORNERS, FACES, back_to_front, corners, css, project
from unload.support import checks, files

WIDTH, HEIGHT = 440, 410  # of one agent's half, in pixels
ROOM = 14, 92, 14, 8  # around its container
LEGEND_HEIGHT = 34
RISE = 0.45  # m, how far a box that is being unloaded is drawn above its place
STUCK = task.N_VISIBLE  # failed picks in a row after which an agent counts as stuck
SLOW, STEP = 10, 9  # frames of one pick each at the beginning, and picks per frame at last
FIRST, EARLY, LATE, LAST = 1500, 240, 80, 5000  # ms that frames are shown
INK, FAINT, RAIL = "#222222", "#6f6f6f", "#e4e4e1"
PALETTE = 127  # colours of all frames, besides white
FINE = 3  # times finer is painted than shown, so that edges are smooth
EDGE = 0.7  # brightness of the edge of a face, as a share of that of the face
# The insides of the container that are seen: corners, and brightness of the grey.
INSIDES = (((0, 4, 6, 2), 0.91), ((0, 2, 3, 1), 0.94), ((2, 6, 7, 3), 0.87))
LEGEND = {
    "unseen": "unseen",
    "visible": "visible",
    "liftable": "unloaded",
    "failed": "failed",
}


class Episode(NamedTuple):
    """What an agent picked in one container, until it was empty or the agent was stuck.

    Attributes:
        load: the items.
        positions: (n, 3) float64, where the agent saw them, m.
        items: (picks,) int64, the item of each pick.
        unloaded: (picks,) bool, whether it was unloaded.
    """

    load: Load
    positions: np.ndarray
    items: np.ndarray
    unloaded: np.ndarray


def record_episode(policy: Policy, seed: int, **env_kwargs) -> Episode:
    """Let an agent unload a container without the mask.

    The episode ends when the container is empty, or after 128 failed picks in a row.

    Args:
        policy: see ``unload.policies``.
        seed: of the load and of the policy's random numbers.
        **env_kwargs: arguments of ``ContainerEnv``, such as ``stack``.
    """
    env = ContainerEnv(physics="table", max_picks=10**6, **env_kwargs)
    rng = np.random.default_rng(checks.integer("seed", seed, 0))
    seen, info = env.reset(seed=seed)
    positions = env.observed_positions()
    items, unloaded, emptied = [], [], False
    while not emptied and (len(items) < STUCK or any(unloaded[-STUCK:])):
        action = int(policy(seen[None], info["item_mask"][None], rng)[0])
        seen, reward, emptied, _, info = env.step(action)
        items.append(info["item"])
        unloaded.append(reward > 0)
    load = env.physics.load
    env.close()
    return Episode(load, positions, np.array(items), np.array(unloaded))


def first_deadlock(policy: Policy, seed: int, most: int = 100, **env_kwargs) -> int:
    """Return the first seed from ``seed`` on with which the agent gets stuck.

    Raises:
        ValueError: it empties all of the ``most`` containers that are tried.
    """
    for tried in range(seed, seed + most):
        if not record_episode(policy, tried, **env_kwargs).unloaded[-1]:
            return tried
    raise ValueError(f"the policy empties the containers of seeds {seed} to {seed + most - 1}")


def save_unloading(episodes: Mapping[str, Episode], path: str | Path) -> list[Image.Image]:
    """Write a GIF of agents that pick at the same pace; the same bytes for the same episodes.

    Args:
        episodes: title → episode, from left to right.
        path: of the GIF.

    Returns:
        Its frames.
    """
    counts = picks_of_frames(max(len(episode.items) for episode in episodes.values()))
    halves = [_Half(title, episode) for title, episode in episodes.items()]
    frames = [_frame(halves, *span) for span in zip([0, *counts], counts)]
    palette = _palette(frames)
    first, *others = (frame.quantize(palette=palette, dither=0) for frame in frames)
    late = len(frames) - 2 - SLOW
    durations = [FIRST, *[EARLY] * SLOW, *[LATE] * late][: len(frames) - 1] + [LAST]
    files.write_atomically(
        path,
        lambda file: first.save(
            file, "GIF", save_all=True, append_images=others, duration=durations, loop=0
        ),
    )
    return frames


def picks_of_frames(picks: int) -> list[int]:
    """How many picks are over in each frame: none, one more each, then more; the end twice."""
    counts = list(range(min(SLOW, picks) + 1))
    while counts[-1] < picks:
        counts.append(min(picks, counts[-1] + min(STEP, len(counts) - SLOW + 1)))
    return [*counts, picks]


def _palette(frames: list[Image.Image]) -> Image.Image:
    """An image with one palette for all frames, taken from the first, a middle and the last."""
    chosen = [frames[0], frames[len(frames) // 2], frames[-1]]
    sample = np.concatenate([np.asarray(frame).reshape(-1, 3) for frame in chosen])
    sample = sample[sample.min(axis=1) < 246]  # white is added, or it would become a light grey
    colours = Image.fromarray(sample[np.newaxis]).quantize(PALETTE).getpalette()[: 3 * PALETTE]
    palette = Image.new("P", (1, 1))
    palette.putpalette([*colours, 255, 255, 255])
    return palette


class Painter:
    """Paints the boxes of one load as ``unload.load.view`` draws it, but fast enough for a film.

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


class _Half:
    """One agent's half of the picture."""

    def __init__(self, title: str, episode: Episode) -> None:
        self._title, self._episode = title, episode
        self._painter = Painter(episode.load, (WIDTH, HEIGHT), ROOM)

    def picture(self, before: int, now: int) -> Image.Image:
        """The state after ``now`` picks; those after the first ``before`` are marked."""
        image = self._container(before, now)
        load, _, items, unloaded = self._episode
        count = int(unloaded[:now].sum())
        draw = ImageDraw.Draw(image)
        draw.text((16, 12), self._title, INK, _font(17, bold=True))
        draw.text((WIDTH - 16, 12), f"{count} of {len(load)}", INK, _font(17, bold=True), "ra")
        draw.rounded_rectangle((16, 41, WIDTH - 16, 48), 3, RAIL)
        if count:
            end = 22 + (WIDTH - 38) * count / len(load)
            draw.rounded_rectangle((16, 41, end, 48), 3, css(COLOURS["liftable"]))
        text, colour = self._state(now)
        draw.text((16, 56), text, colour, _font(14, bold=colour != FAINT))
        return image

    def _state(self, now: int) -> tuple[str, str]:
        """What to say of the last pick, and the colour to say it in."""
        _, _, items, unloaded = self._episode
        if unloaded[-1] and now >= len(items):
            text = f"empty after {len(items)} picks, {(~unloaded).sum()} of them failed"
            return text, css(COLOURS["liftable"])
        picked = items[:now]
        others = np.flatnonzero(unloaded[:now] | (picked != picked[-1:]))
        fails = now - (int(others[-1]) + 1 if len(others) else 0)  # of the same box, at the end
        if fails > 1:
            return f"deadlock: the same box fails, {fails} times", css(COLOURS["failed"])
        return f"pick {now}", FAINT

    def _container(self, before: int, now: int) -> Image.Image:
        load, positions, items, unloaded = self._episode
        present = np.ones(len(load), dtype=bool)
        present[items[:before][unloaded[:before]]] = False
        rising = items[before:now][unloaded[before:now]]
        left = np.flatnonzero(present)
        seen = left[observation.nearest(positions[left])] if len(left) else left
        failed = items[-1:] if now > len(items) else items[before:now][~unloaded[before:now]]
        colours = np.tile(COLOURS["unseen"], (len(load), 1))
        for meaning, those in (("visible", seen), ("liftable", rising), ("failed", failed)):
            colours[those] = COLOURS[meaning]
        rise = np.zeros(len(load))
        rise[rising] = RISE
        shown = np.unique(failed[present[failed]]).tolist()
        return self._painter.paint(present, colours, rise, shown)


def _frame(halves: list[_Half], before: int, now: int) -> Image.Image:
    width = WIDTH * len(halves)
    frame = Image.new("RGB", (width, HEIGHT + LEGEND_HEIGHT), "white")
    for place, half in enumerate(halves):
        frame.paste(half.picture(before, now), (place * WIDTH, 0))
    draw = ImageDraw.Draw(frame)
    for place in range(1, len(halves)):
        draw.line((place * WIDTH, 14, place * WIDTH, HEIGHT - 14), RAIL)
    font = _font(13)
    lengths = [26 + font.getlength(text) + 28 for text in LEGEND.values()]
    x, y = (width - sum(lengths) + 28) / 2, HEIGHT + 8
    for (meaning, text), length in zip(LEGEND.items(), lengths):
        draw.rectangle((x, y, x + 14, y + 14), css(COLOURS[meaning]))
        draw.text((x + 22, y - 1), text, INK, font)
        x += length
    return frame


def _font(size: int, bold: bool = False) -> ImageFont.FreeTypeFont:
    """The font that comes with Matplotlib."""
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(Path(get_data_path()) / "fonts" / "ttf" / name, size)
