"""Episodes of heaps with a slider."""

import json

import numpy as np
import pytest

from unload.heap.rake import Outcome
from unload.heap.study.figures import MEANINGS, corners
from unload.heap.study.replay import Played, replay_heaps
from unload.load.view import COLOURS, css


@pytest.fixture
def played(heap, outcome) -> Played:
    return Played([heap, outcome.heap], np.array([0]), [outcome])


def test_episodes_follow_the_boxes_of_the_first_heap(played, outcome):
    places, numbers = played.state(1)
    assert places[[1, 3]] == pytest.approx(corners(outcome.heap)) and not numbers.any()
    assert np.ptp(places[[0, 2]], axis=1).max() == 0, "gone: of no extent"
    assert np.array_equal(played.state(9)[0], places), "after its end it stays"
    assert played.title("lowest", 0) == "lowest: 0 unloaded, 0 fallen"
    assert played.title("lowest", 5) == "lowest: 2 unloaded, 1 fallen"
    after = outcome.heap.only(np.array([1]))
    gone, none = np.array([True, False]), np.zeros(2, bool)
    second = Outcome(after, np.array([1]), gone, none, 0.7, True)
    longer = Played([*played.heaps, after], np.array([0, 0]), [outcome, second])
    assert longer.state(2)[0][3] == pytest.approx(corners(after)[0])


def test_a_replay_has_a_stop_for_each_pick_and_needs_no_kernel(played, heap):
    replay = replay_heaps({"left": played, "right": played})
    assert [frame.name for frame in replay.frames] == ["0", "1"]
    assert [step["args"][0][0] for step in replay.layout.sliders[0].steps] == ["0", "1"]
    assert {trace.scene for trace in replay.data[:2]} == {"scene", "scene2"}
    mesh = replay.data[0]
    assert len(mesh.x) == 8 * len(heap) and len(mesh.i) == 12 * len(heap)
    assert mesh.intensity.tolist() == [3] * 12 + [2] * 12 + [1] * 12 + [0] * 12
    assert css(COLOURS["tried"]) in {colour for _, colour in mesh.colorscale}
    assert mesh.x.dtype == np.int16
    assert mesh.x == pytest.approx(1000 * played.state(0)[0][..., 0].ravel(), abs=0.5)
    assert [trace.name for trace in replay.data[2:]] == list(MEANINGS)
    assert replay.layout.scene.xaxis.range[0] == 4000
    titles = [note.text for note in replay.frames[1].layout.annotations]
    assert titles == ["left: 2 unloaded, 1 fallen", "right: 2 unloaded, 1 fallen"]
    bundle = replay._repr_mimebundle_()
    assert "image/png" in bundle and len(json.dumps(bundle)) > 1000
    assert replay.picture()[:4] == b"\x89PNG" and replay.picture() == replay.picture()


def test_bad_input_is_refused(heap, outcome):
    with pytest.raises(ValueError, match=r"len\(episodes\) is 0"):
        replay_heaps({})
    with pytest.raises(ValueError, match="expected one heap more than picks"):
        Played([heap], np.array([0]), [outcome])
