import numpy as np

from studies.play.episode import Episode, Run
from studies.play.replay import PAUSE, STOPS, replay


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
