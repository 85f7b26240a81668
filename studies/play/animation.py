"""The README's moving picture: agents unload the same load side by side."""

from collections.abc import Mapping
from itertools import takewhile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle
from PIL import Image

from studies.play.episode import Run
from studies.style import styled
from unload import task
from unload.agent.evaluation import Policy
from unload.drawing.picture import COLOURS, back_to_front, corners, draw, pixels
from unload.support import files

WIDTH, HEIGHT = 4.4, 4.4  # of one agent's part, in inches at 100 pixels each
RISE = 0.45  # m, how far a box that is being unloaded is drawn above its place
STUCK = task.N_VISIBLE  # failed picks in a row after which an agent counts as stuck
SLOW = 4  # frames of one pick each, at the beginning and when a pick has failed
ALIKE, STEP = 27, 9  # picks per frame before any pick fails, and later
FIRST, EARLY, LATE, LAST = 600, 150, 80, 3000  # ms that frames are shown
FAINT, RAIL = "#6f6f6f", "#e4e4e1"
DARK = 0.7  # times a box's colour is that of text, to be read on white
PALETTE = 127  # colours of all frames, besides white
LEGEND = {"unseen": "unseen", "visible": "visible", "liftable": "unloaded", "failed": "failed"}


def record_episode(policy: Policy, seed: int, mask: bool = False) -> Run:
    """Let an agent unload a container.

    The episode ends when the container is empty, or after 128 failed picks in a row.

    Args:
        policy: see ``unload.policies``.
        seed, mask: see ``Run``.
    """
    run = Run(policy, None, seed, mask)
    while run.allowed(mask).any() and (
        len(run.picks) < STUCK or any(pick.success for pick in run.picks[-STUCK:])
    ):
        run.pick(run.choose())
    return run


def save_unloading(episodes: Mapping[str, Run], path: str | Path) -> list[Image.Image]:
    """Write a GIF of agents that pick at the same pace; the same bytes for the same episodes.

    Args:
        episodes: title → episode, from left to right.
        path: of the GIF.

    Returns:
        Its frames in the order of the picks; the file begins with the middle one.
    """
    runs = episodes.values()
    picks = max(len(run.picks) for run in runs)
    failures = (n for run in runs for n, pick in enumerate(run.picks) if not pick.success)
    counts = picks_of_frames(picks, min(failures, default=picks))
    spans = [*zip([0, *counts], counts)]
    frames = [_frame(episodes, *span) for span in spans]
    palette = _palette(frames)
    durations = [EARLY if now - before == 1 else LATE for before, now in spans]
    durations[0], durations[-1] = FIRST, LAST
    # The middle comes first, because who sees one picture alone should see how the agents differ.
    middle = len(frames) // 2
    durations = durations[middle:] + durations[:middle]
    shown = frames[middle:] + frames[:middle]
    first, *others = (frame.quantize(palette=palette, dither=0) for frame in shown)
    files.write_atomically(
        path,
        lambda file: first.save(
            file, "GIF", save_all=True, append_images=others, duration=durations, loop=0
        ),
    )
    return frames


def picks_of_frames(picks: int, failed: int) -> list[int]:
    """How many picks are over in each frame: none, one more each, then more; the end twice.

    Args:
        picks: number of all.
        failed: picks before the first that fails, which is where agents come to differ.
    """
    slow = [start + number for start in (0, failed) for number in range(SLOW + 1)]
    counts = {*slow, *range(SLOW, failed, ALIKE), *range(failed + SLOW, picks, STEP)}
    return [*sorted(count for count in counts if count < picks), picks, picks]


def _palette(frames: list[Image.Image]) -> Image.Image:
    """One palette for all frames, taken from the first, a middle and the last."""
    chosen = [frames[0], frames[len(frames) // 2], frames[-1]]
    sample = np.concatenate([np.asarray(frame).reshape(-1, 3) for frame in chosen])
    sample = sample[sample.min(axis=1) < 246]  # white is added, or it would become a light grey
    colours = Image.fromarray(sample[np.newaxis]).quantize(PALETTE).getpalette()[: 3 * PALETTE]
    palette = Image.new("P", (1, 1))
    palette.putpalette([*colours, 255, 255, 255])
    return palette


@styled
def _frame(episodes: Mapping[str, Run], before: int, now: int) -> Image.Image:
    """All agents after ``now`` picks; those after the first ``before`` are marked."""
    figure = Figure((WIDTH * len(episodes), HEIGHT), dpi=100, layout="none")
    parts = figure.subfigures(1, len(episodes), squeeze=False)[0]
    for part, (title, run) in zip(parts, episodes.items()):
        _draw_part(part, title, run, before, now)
    handles = [Patch(color=COLOURS[meaning], label=text) for meaning, text in LEGEND.items()]
    figure.legend(handles=handles, loc="lower center", ncols=len(handles))
    return Image.fromarray(pixels(figure))


def _draw_part(part: Figure, title: str, run: Run, before: int, now: int) -> None:
    """One agent: its title, how far it has come, what its last pick was, and its container."""
    count, bold = run.unloaded(now), {"fontsize": 13, "fontweight": "bold"}
    part.text(0.04, 0.94, title, **bold)
    part.text(0.96, 0.94, f"{count} of {len(run.load)}", ha="right", **bold)
    for length, colour in ((1, RAIL), (count / len(run.load), COLOURS["liftable"])):
        part.add_artist(Rectangle((0.04, 0.9), 0.92 * length, 0.015, color=colour))
    text, colour = _state(run, now)
    part.text(0.04, 0.84, text, color=colour, fontsize=11)
    low, high, colours = _boxes(run, before, now)
    draw(part.add_axes((0.02, 0.08, 0.96, 0.75)), low, high, colours)


def _state(run: Run, now: int) -> tuple[str, str | tuple]:
    """What to say of the last pick, and the colour to say it in."""
    count, picks = len(run.picks), run.picks[:now]
    if run.picks[-1].success and now >= count:
        text = f"empty after {count} picks, {count - run.unloaded()} of them failed"
        return text, _dark("liftable")
    same = takewhile(lambda pick: pick.item == picks[-1].item and not pick.success, picks[::-1])
    fails = len(list(same)) + max(0, now - count)
    if fails > 1:
        return f"deadlock: the same box fails, {fails} times", _dark("failed")
    return f"pick {now}, {len(picks) - run.unloaded(now)} failed", FAINT


def _dark(meaning: str) -> tuple:
    """The colour of text about boxes of a meaning."""
    return tuple(DARK * share for share in COLOURS[meaning])


def _boxes(run: Run, before: int, now: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Corners and colours of the boxes in the order in which they are drawn, see ``draw``."""
    load, count = run.load, len(run.picks)
    moment = run.moment(min(before, count))
    present, picks = moment.present, run.picks[before:now]
    rising = np.array([pick.item for pick in picks if pick.success], int)
    # Of an agent that is stuck, the last pick is shown as long as the others go on.
    tried = picks if now <= count else run.picks[-1:]
    failed = np.array([pick.item for pick in tried if not pick.success], int)
    colours = np.tile(COLOURS["unseen"], (len(load), 1))
    for meaning, those in (("visible", moment.visible), ("liftable", rising), ("failed", failed)):
        colours[those] = COLOURS[meaning]
    low, high = corners(load, np.arange(len(load)))
    order = back_to_front(low, high)
    for corner in (low, high):
        corner[rising, 2] += RISE
    order = order[present[order]]
    return low[order], high[order], colours[order]
