"""The README's moving picture."""

import numpy as np
import pytest
from PIL import Image

from studies.play import animation
from studies.policies.robustness import front_walls
from tests.agent.runs import lowest
from unload import policies
from unload.load import picture
from unload.load.substacks import stack_load


@pytest.fixture(scope="module")
def episodes():
    """Two agents with one wall of a load."""
    wall = front_walls(stack_load(np.random.default_rng(3)), 1)
    return {
        "stuck": animation.record_episode(lowest, 3, wall),
        "empty": animation.record_episode(policies.highest, 3, wall),
    }


def test_episode_ends_when_the_container_is_empty_or_the_agent_stuck(episodes):
    stuck, empty = episodes["stuck"], episodes["empty"]
    assert empty.unloaded() == len(empty.load) == len(empty.picks)
    assert len({pick.item for pick in stuck.picks}) == 1 and not stuck.unloaded()
    assert len(stuck.picks) == animation.STUCK


def test_frames_begin_slowly_and_show_the_end_twice():
    counts = animation.picks_of_frames(900)
    assert counts[:11] == list(range(11)) and counts[-2:] == [900, 900]
    steps = np.diff(counts[:-2])
    assert (np.diff(steps) >= 0).all() and steps.max() == animation.STEP
    assert animation.picks_of_frames(2) == [0, 1, 2, 2]


def test_gif_is_saved_as_the_same_bytes_and_tells_what_happens(episodes, tmp_path, monkeypatch):
    texts, drawn, draw_half = [], [], animation._draw_half

    def noting(half, *args):
        draw_half(half, *args)
        texts.extend(text.get_text() for text in half.texts)

    monkeypatch.setattr(animation, "_draw_half", noting)
    monkeypatch.setattr(animation, "draw", lambda *all: drawn.append(all[1:]) or picture.draw(*all))
    first, second = tmp_path / "a.gif", tmp_path / "b.gif"
    frames = animation.save_unloading(episodes, first)
    picks, boxes = len(episodes["stuck"].picks), len(episodes["empty"].load)
    for said in (
        f"deadlock: the same box fails, {picks} times",
        f"0 of {boxes}",
        f"{boxes} of {boxes}",
        f"empty after {boxes} picks, 0 of them failed",
    ):
        assert said in texts
    stuck, empty = ([len(low) for low, _, _ in drawn[half::2]] for half in (0, 1))
    assert empty[0] == boxes and empty[-1] == 0
    assert stuck[1] == boxes + 1, "the box that fails is drawn again, before all others"
    animation.save_unloading(episodes, second)
    assert first.read_bytes() == second.read_bytes()
    with Image.open(first) as image:
        assert image.n_frames == len(frames) == len(animation.picks_of_frames(picks))
