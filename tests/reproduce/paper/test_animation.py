"""The README's moving picture."""

from functools import partial

import numpy as np
import pytest
from PIL import Image

from unload import policies, task
from unload.load.boxes import Load
from unload.load.substacks import front_walls, stack_load
from unload.reproduce.paper import animation
from unload.support import files


def small(rng):
    """One wall of a load."""
    return front_walls(stack_load(rng), 1)


def lowest(observations, masks, rng):
    """The lowest item, which has others on it."""
    return np.where(masks, observations[..., 2], np.inf).argmin(axis=1)


@pytest.fixture(scope="module")
def episodes():
    return {
        "stuck": animation.record_episode(lowest, 3, stack=small),
        "empty": animation.record_episode(policies.highest, 3, stack=small),
    }


def test_episode_ends_when_the_container_is_empty_or_the_agent_stuck(episodes):
    stuck, empty = episodes["stuck"], episodes["empty"]
    assert empty.unloaded.all() and sorted(empty.items) == list(range(len(empty.load)))
    assert len(set(stuck.items)) == 1 and not stuck.unloaded.any()
    assert len(stuck.items) == animation.STUCK
    assert np.array_equal(stuck.load.positions, empty.load.positions)


def test_first_deadlock_is_the_first_seed_that_ends_with_a_failure(episodes, monkeypatch):
    def record(policy, seed):
        return episodes["stuck" if seed in (2, 7, 8) else "empty"]

    monkeypatch.setattr(animation, "record_episode", record)
    assert animation.first_deadlock(lowest, 3) == 7
    with pytest.raises(ValueError, match="empties the containers of seeds 3 to 6"):
        animation.first_deadlock(lowest, 3, most=4)


def test_frames_begin_slowly_and_show_the_end_twice():
    counts = animation.picks_of_frames(900)
    assert counts[:11] == list(range(11)) and counts[-2:] == [900, 900]
    steps = np.diff(counts[:-2])
    assert (np.diff(steps) >= 0).all() and steps.max() == animation.STEP
    assert animation.picks_of_frames(2) == [0, 1, 2, 2]


def test_gif_is_saved_as_the_same_bytes_and_tells_what_happens(episodes, tmp_path, monkeypatch):
    texts = []
    draw = animation.ImageDraw.ImageDraw.text

    def note(self, place, text, *args, **kwargs):
        texts.append(text)
        draw(self, place, text, *args, **kwargs)

    monkeypatch.setattr(animation.ImageDraw.ImageDraw, "text", note)
    first, second = tmp_path / "a.gif", tmp_path / "b.gif"
    frames = animation.save_unloading(episodes, first)
    picks, boxes = len(episodes["stuck"].items), len(episodes["empty"].load)
    for said in (
        f"deadlock: the same box fails, {picks} times",
        f"0 of {boxes}",
        f"{boxes} of {boxes}",
        f"empty after {boxes} picks, 0 of them failed",
    ):
        assert said in texts
    animation.save_unloading(episodes, second)
    assert first.read_bytes() == second.read_bytes()
    with Image.open(first) as image:
        assert image.n_frames == len(frames) == len(animation.picks_of_frames(picks))
        image.seek(image.n_frames - 1)
        shown = np.asarray(image.convert("RGB")).astype(int)
    assert np.abs(shown - np.asarray(frames[-1])).mean() < 2  # the palette serves all frames
    container = shown[animation.ROOM[1] : animation.HEIGHT, animation.WIDTH + 8 :]
    assert (np.ptp(container, axis=2) < 12).all(), "the emptied container has no coloured box"


def test_committed_picture_is_small_enough_for_a_readme():
    assert (files.FIGURES / "unloading.gif").stat().st_size <= 2_000_000


SIZE, ROOM = (120, 100), (5, 10, 5, 10)


def pile(*boxes):
    """A load of boxes given by their low and high corners in m."""
    low, high = np.array(boxes, dtype=float).transpose(1, 0, 2)
    numbers = np.arange(len(boxes))
    return Load((low + high) / 2, high - low, numbers, numbers)


def painted(load, present=None, rise=None, shown=()):
    present = np.ones(len(load), dtype=bool) if present is None else present
    colours = np.eye(3)[np.arange(len(load)) % 3]
    rise = np.zeros(len(load)) if rise is None else rise
    return np.asarray(
        animation.Painter(load, SIZE, ROOM).paint(present, colours, rise, list(shown))
    )


def pixels_of(picture, channel):
    """How many pixels have the colour of the boxes painted in one channel only."""
    others = [other for other in range(3) if other != channel]
    return int(((picture[..., channel] > 150) & (picture[..., others] < 30).all(axis=-1)).sum())


@pytest.mark.parametrize(
    "hiding",
    [((3, 0, 0), (4, 2, 2)), ((1, 0, 0), (3, 0.2, 2)), ((1, 0, 1.8), (3, 2, 2.4))],
    ids=["before", "left of", "above"],
)
def test_a_box_hides_what_is_behind_it_whatever_their_order(hiding):
    hidden = ((1, 0.5, 0), (2, 1, 1.5))
    for boxes, front in (((hidden, hiding), 1), ((hiding, hidden), 0)):
        load = pile(*boxes)
        alone = np.arange(2) == front
        whole = pixels_of(painted(load, alone), front)
        assert whole > 50
        assert abs(pixels_of(painted(load), front) - whole) <= 2  # its edge is blended


def test_container_fills_what_the_room_leaves():
    full = painted(pile(((0, 0, 0), task.CONTAINER)))
    rows, columns = (np.flatnonzero((full < 255).any(axis=(2, axis))) for axis in (1, 0))
    assert rows[0] >= 10 and rows[-1] <= 90 and columns[0] >= 5 and columns[-1] <= 115
    assert np.ptp(rows) >= 78 or np.ptp(columns) >= 108


def test_picked_boxes_rise_and_taken_ones_are_not_drawn():
    load = pile(((6, 0, 0), (7, 1, 1)))
    draw = partial(painted, load)
    top = [np.flatnonzero((picture[..., 0] > 250) & (picture[..., 1] < 30))[0] // SIZE[0]
           for picture in (draw(), draw(rise=np.array([1.0])))]  # fmt: skip
    assert top[1] < top[0] - 5
    assert pixels_of(draw(np.zeros(1, dtype=bool)), 0) == 0


def test_shown_boxes_are_seen_through_others():
    load = pile(((1, 0.5, 0), (2, 1, 1.5)), ((3, 0, 0), (4, 2, 2)))
    hidden = [pixels_of(painted(load, shown=shown), 0) for shown in ((), (0,))]
    assert hidden[1] > hidden[0] + 50
