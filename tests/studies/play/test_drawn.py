"""How a load is drawn: in the widget, by what an agent sees, and in the replay beside it."""

from dataclasses import replace

import numpy as np
import pytest

import unload
from studies.play.agent_view import agent_view, look
from studies.play.canvas import ABSENT, Canvas
from studies.play.episode import Episode, Run, policy_of
from studies.play.replay import PAUSE, STOPS, replay
from unload.load.picture import COLOURS


def test_the_canvas_holds_the_load_and_a_pick_is_one_small_message(full_load, monkeypatch):
    canvas = Canvas(full_load)
    corners = np.frombuffer(canvas.boxes, np.float32).reshape(-1, 2, 3)
    assert np.allclose(corners.mean(axis=1), full_load.positions, atol=1e-5)
    assert np.allclose(np.ptp(corners, axis=1), full_load.sizes, atol=1e-5)
    x, y, z = np.rint(full_load.sizes[7] * 1000).astype(int)
    assert canvas.labels[7] == f"item 7, package {full_load.packages[7]}: {x} × {y} × {z} mm"
    sent = []
    monkeypatch.setattr(canvas, "send_state", lambda key=None: sent.append(key))
    numbers = np.zeros(len(full_load), int)
    numbers[3] = ABSENT
    lifts = []
    for _ in range(2):
        on_it = {"on it": np.array([5])}
        canvas.show(numbers, {"visible": (0, 0.5, 1)}, on_it, (3, 0.46, (0, 1, 0)))
        lifts.append(canvas.lift["number"])
    assert len(sent) == 2 and not {"boxes", "labels"} & set().union(*sent)
    assert canvas.colours[3] == ABSENT and len(canvas.colours) == len(full_load)
    assert canvas.outlined == [5]
    assert [line[0] for line in canvas.legend] == ["visible", "on it"]
    assert lifts == [1, 2], "the same lift twice is seen twice"


def hidden(frame) -> list[int]:
    """The meshes that a frame hides, without that of the failed item."""
    return [n for n, trace in zip(frame.traces, frame.data[:-1]) if trace.visible is False]


def test_items_vanish_in_the_order_of_the_picks_at_the_stops_of_the_slider(full_load):
    run = Run("highest", full_load, 0)
    run.play_to(100)
    figure = replay(run)
    for stop, frame in enumerate(figure.frames):
        gone = [figure.data[n].customdata[::8, 0] for n in hidden(frame)]
        gone = np.concatenate([[], *gone]).astype(int).tolist()
        assert gone == [pick.item for pick in run.picks[: int(frame.name)]]
        assert len(hidden(frame)) == stop
    drawn = np.concatenate([trace.customdata[::8, 0] for trace in figure.data[:-1]])
    assert sorted(drawn) == list(range(len(full_load)))
    steps = figure.layout.sliders[0].steps
    assert [step.args[0][0] for step in steps] == [frame.name for frame in figure.frames]
    assert len(steps) == STOPS + 1 and steps[-1].label == "100 picks, 100 unloaded"
    play, pause = figure.layout.updatemenus[0].buttons
    assert play.args[0] is None and list(pause.args[0]) == [None]
    assert play.args[1]["frame"]["duration"] == PAUSE and play.args[1]["fromcurrent"]


def test_a_failed_pick_is_marked_in_the_container_of_the_load(boxes):
    small = replace(boxes((1.0, 0.2), (1.0, 0.6)), container=np.array([6.0, 2.0, 2.0]))
    episode = Episode(small, 0)
    for item in (0, 1, 0):
        episode.pick(item)
    figure = replay(episode)
    marks = [frame.data[-1] for frame in figure.frames]
    assert [mark.visible for mark in marks] == ["legendonly", True, "legendonly", "legendonly"]
    assert marks[1].customdata[0, 0] == 0 and figure.data[-1].visible == "legendonly"
    assert figure.layout.scene.xaxis.range == (0, 6)


@pytest.fixture(scope="module")
def stuck() -> Run:
    """The paper's agent where it gets stuck."""
    run = Run("the paper's agent", unload.stack_load(np.random.default_rng(4)), 4, mask=False)
    run.play_to(95)
    return run


SETTINGS = {
    "agent": "the paper's agent", "epsilon": 0, "noise": 0.5, "number": 0, "ties": "noise",
}  # fmt: skip


@pytest.mark.parametrize(
    ("changed", "can"),
    [
        ({}, False),
        ({"number": 3}, True),
        ({"agent": "the recommended agent"}, True),
        ({"noise": 0}, True),
        ({"ties": "average"}, True),
    ],
)
def test_the_settings_show_why_the_agent_is_stuck(stuck, changed, can):
    """Draw 0 is the noise that it is stuck with; without noise or ties it is not."""
    title = agent_view(stuck, **SETTINGS | changed).axes[0].get_title()
    assert f" {'can' if can else 'cannot'} be lifted" in title
    assert ("item 637 of" in title) is not can
    ranks = int(title.split()[0])
    assert ranks < 30 if changed == {"ties": "average"} else ranks == 128


def test_colours_are_ranks_and_the_choice_is_in_front(stuck, monkeypatch):
    drawn = []
    monkeypatch.setattr("studies.play.agent_view.draw", lambda *given: drawn.append(given))
    _, legend = agent_view(stuck, **SETTINGS).axes
    assert legend.get_ylim() == (0, 127)
    ((_, low, high, colours),) = drawn
    assert len(low) == len(stuck.load) - stuck.unloaded() + 1  # the choice is drawn once more
    assert (low[-1] + high[-1]) / 2 == pytest.approx(stuck.load.positions[637])
    assert tuple(colours[-1]) == COLOURS["failed"]
    seen = (colours != COLOURS["unseen"]).any(axis=1) & (colours != COLOURS["failed"]).any(axis=1)
    assert len(np.unique(colours[seen], axis=0)) == 127  # every rank once, but for the choice's
    heights = (low + high)[seen, 2]
    assert np.corrcoef(heights, colours[seen].sum(axis=1))[0, 1] < -0.9  # dark is high


def test_chance_mixes_the_greedy_and_a_random_pick(full_load):
    env = unload.ContainerEnv(physics="table", position_noise=0)
    env.reset(seed=0, options={"load": full_load})
    seen = full_load.positions[env.visible], env.liftable()
    share = seen[1].mean()
    for epsilon, expected in ((0, 1), (1, share), (0.5, (1 + share) / 2)):
        chance = look(*seen, policy_of("the recommended agent"), epsilon, "noise")[2]
        assert chance == pytest.approx(expected)
