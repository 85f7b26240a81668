"""How a load is drawn: in the widget, by what an agent sees, and in the replay beside it."""

import re

import numpy as np
import pytest

import unload
from studies.play.agent_view import LEVELS, AgentView, look
from studies.play.canvas import ABSENT, Canvas
from studies.play.episode import Episode, Run, policy_of
from studies.play.replay import PAUSE, STOPS, replay


def test_boxes_and_labels_are_those_of_the_load(full_load):
    canvas = Canvas(full_load)
    corners = np.frombuffer(canvas.boxes, np.float32).reshape(-1, 2, 3)
    assert np.allclose(corners.mean(axis=1), full_load.positions, atol=1e-5)
    assert np.allclose(np.ptp(corners, axis=1), full_load.sizes, atol=1e-5)
    x, y, z = np.rint(full_load.sizes[7] * 1000).astype(int)
    assert canvas.labels[7] == f"item 7, package {full_load.packages[7]}: {x} × {y} × {z} mm"


def test_a_pick_is_one_small_message(full_load, monkeypatch):
    canvas = Canvas(full_load)
    sent = []
    monkeypatch.setattr(canvas, "send_state", lambda key=None: sent.append(key))
    numbers = np.zeros(len(full_load), int)
    numbers[3] = ABSENT
    canvas.show(numbers, {"visible": (0, 0.5, 1)}, {"on it": np.array([5])}, (3, 0.46, (0, 1, 0)))
    assert len(sent) == 1 and "boxes" not in sent[0] and "labels" not in sent[0]
    assert canvas.colours[3] == ABSENT and len(canvas.colours) == len(full_load)
    assert canvas.outlined == [5]
    assert [line[0] for line in canvas.legend] == ["visible", "on it"]


def test_the_same_lift_twice_is_seen_twice(small_load):
    canvas = Canvas(small_load)
    seen = []
    canvas.observe(lambda change: seen.append(change["new"]["number"]), "lift")
    for _ in range(2):
        canvas.show(np.zeros(len(small_load)), {}, {}, (3, 0.46, (0, 1, 0)))
    assert seen == [1, 2]


def hidden(frame) -> list[int]:
    """The meshes that a frame hides, without that of the failed item."""
    return [n for n, trace in zip(frame.traces, frame.data[:-1]) if trace.visible is False]


def test_items_vanish_in_the_order_of_the_picks(full_load):
    run = Run("highest", full_load)
    run.play_to(100)
    figure = replay(run)
    assert len(figure.frames) == STOPS + 1
    for stop, frame in enumerate(figure.frames):
        gone = [figure.data[n].customdata[::8, 0] for n in hidden(frame)]
        gone = np.concatenate([[], *gone]).astype(int).tolist()
        assert gone == [pick.item for pick in run.picks[: int(frame.name)]]
        assert len(hidden(frame)) == stop
    drawn = np.concatenate([trace.customdata[::8, 0] for trace in figure.data[:-1]])
    assert sorted(drawn) == list(range(len(full_load)))


def test_a_failed_pick_is_marked(boxes):
    episode = Episode(boxes((1.0, 0.2), (1.0, 0.6)))
    for item in (0, 1, 0):
        episode.pick(item)
    marks = [frame.data[-1] for frame in replay(episode).frames]
    assert [mark.visible for mark in marks] == ["legendonly", True, "legendonly", "legendonly"]
    assert marks[1].customdata[0, 0] == 0


def test_slider_and_frames_have_the_same_stops(full_load):
    run = Run("random", full_load, mask=False)
    run.play_to(50)
    figure = replay(run)
    steps = figure.layout.sliders[0].steps
    assert [step.args[0][0] for step in steps] == [frame.name for frame in figure.frames]
    assert steps[-1].label == f"50 picks, {run.unloaded()} unloaded"
    play, pause = figure.layout.updatemenus[0].buttons
    assert play.args[0] is None and list(pause.args[0]) == [None]
    assert play.args[1]["frame"]["duration"] == PAUSE and play.args[1]["fromcurrent"]


@pytest.fixture
def stuck():
    """The paper's agent where it gets stuck."""
    return AgentView(seed=4, agent="the paper's agent", picks=95)


def ranks_and_item(view) -> tuple[int, int]:
    """The number of different ranks, and the item of the greedy choice, as they are shown."""
    ranks, item = re.findall(r"<b>(\d+)</b>", view.message.value)[:2]
    return int(ranks), int(item)


def test_draw_0_is_the_noise_that_the_agent_is_stuck_with(stuck):
    assert ranks_and_item(stuck) == (128, 637)
    assert "<b>cannot</b> be lifted" in stuck.message.value
    stuck.draw.value = 3
    assert "<b>can</b> be lifted" in stuck.message.value
    stuck.draw.value, stuck.agent.value = 0, "the recommended agent"
    assert "<b>can</b> be lifted" in stuck.message.value


def test_without_noise_or_ties_it_is_not_stuck(stuck):
    stuck.noise.value = 0
    assert "<b>can</b> be lifted" in stuck.message.value
    stuck.noise.value = 0.5
    assert "<b>cannot</b> be lifted" in stuck.message.value
    stuck.ties.value = "average"
    assert "<b>can</b> be lifted" in stuck.message.value
    assert ranks_and_item(stuck)[0] < 30


def test_colours_are_ranks_and_the_choice_is_outlined(stuck):
    numbers = np.frombuffer(stuck.canvas.colours, np.uint8)
    counts = np.bincount(numbers[numbers < LEVELS])
    assert counts.tolist() == [128 // LEVELS] * LEVELS  # every rank once
    assert (numbers == ABSENT).sum() == 94
    assert stuck.canvas.outlined == [ranks_and_item(stuck)[1]]


@pytest.fixture
def seen(full_load):
    """Positions of visible items, and which can be lifted, in the order of height."""
    env = unload.ContainerEnv(physics="table", position_noise=0)
    env.reset(seed=0, options={"load": full_load})
    yield full_load.positions[env.visible], env.liftable()
    env.close()


def test_chance_mixes_the_greedy_and_a_random_pick(seen):
    agent = policy_of("the recommended agent")
    best = look(*seen, agent, 0, "noise")[2]
    assert best == 1
    share = seen[1].mean()
    assert look(*seen, agent, 1, "noise")[2] == pytest.approx(share)
    assert look(*seen, agent, 0.5, "noise")[2] == pytest.approx((1 + share) / 2)
