"""Heaps drawn in three dimensions."""

import json

import matplotlib.pyplot as plt
import numpy as np
import pytest

from unload.heap.boxes import Heap
from unload.heap.rake import Outcome
from unload.load.colours import COLOURS, css
from unload.reproduce.figures import heap_view

TURN = np.array([0, 0, np.sin(np.pi / 8), np.cos(np.pi / 8)])  # 45° about the vertical


@pytest.fixture
def heap() -> Heap:
    """Three upright cubes of 0.4 m, and one that is turned by 45°."""
    positions = np.array([[5, 1, 0.2], [5, 1, 0.6], [6, 2, 0.2], [6, 1, 0.2]])
    turns = np.tile([0.0, 0, 0, 1], (4, 1))
    turns[3] = TURN
    return Heap(positions, turns, np.full((4, 3), 0.4), np.zeros(4, int))


@pytest.fixture
def outcome(heap) -> Outcome:
    """Box 0 was dragged and box 2 came with it; box 1 fell."""
    left = np.array([1, 3])
    after = heap.only(left)
    after = Heap(after.positions - [[0, 0, 0.4], [0, 0, 0]], *(
        getattr(after, name) for name in ("orientations", "sizes", "packages")
    ))  # fmt: skip
    unloaded, fallen = np.array([1, 0, 1, 0], bool), np.array([0, 1, 0, 0], bool)
    return Outcome(after, left, unloaded, fallen, 0.7, True)


@pytest.fixture
def played(heap, outcome) -> heap_view.Played:
    return heap_view.Played([heap, outcome.heap], np.array([0]), [outcome])


def test_corners_are_those_of_turned_boxes(heap):
    corners = heap_view.corners(heap)
    seam = heap_view.SEAM
    assert np.ptp(corners[0], axis=0) == pytest.approx([0.4 - seam] * 3)
    wide = (0.4 - seam) * 2**0.5
    assert np.ptp(corners[3], axis=0) == pytest.approx([wide, wide, 0.4 - seam])
    assert corners.mean(axis=1) == pytest.approx(heap.positions)


def test_a_pick_gives_each_box_its_meaning(outcome):
    names = list(heap_view.MEANINGS)
    numbers = heap_view.meanings(outcome, 0)
    assert [names[n] for n in numbers] == ["is dragged", "falls", "comes along", "stays"]


def test_a_foretold_fate_is_the_share_of_its_colour(heap, outcome):
    """Box 0 is dragged, 3 hidden; 1 falls for certain, and 2 comes in half of the cases."""
    chances = np.array([[1.0, 0], [0, 1], [0.5, 0]])
    figure = heap_view.foretold(heap, 0, np.array([0, 1, 2]), chances, outcome)
    left, right = (
        {tuple(np.round(c[:3] / c[:3].max(), 2)) for c in axes.collections[0].get_facecolors()}
        for axes in figure.axes[:2]
    )

    def tint(colour):
        return tuple(np.round(colour / colour.max(), 2))

    stays, comes, falls, dragged = heap_view.colours_of(np.arange(4))
    assert left == {tint(c) for c in (dragged, falls, (stays + comes) / 2, stays)}
    assert right == {tint(c) for c in (dragged, falls, comes, stays)}


def test_nearer_boxes_are_painted_later(heap):
    """Box 2 is nearer to the eye than box 0, and its top is brighter than its sides."""
    axes = plt.figure().add_subplot()
    heap_view.draw_heap(axes, heap.only(np.array([2, 0])), heap_view.colours_of(np.array([1, 3])))
    painted = axes.collections[0].get_facecolors()[:, :3]
    assert len(painted) == 6, "three faces of a box are turned to the eye"
    dragged, along = (np.array(COLOURS[name]) for name in ("tried", "liftable"))
    own = [np.linalg.norm(face / face.max() - dragged / dragged.max()) < 0.02 for face in painted]
    assert own == [True] * 3 + [False] * 3
    assert painted[3:].max() <= along.max() + 1e-9


def test_one_pick_shows_before_and_after(heap, outcome, saved_twice):
    figure = heap_view.one_pick(heap, 0, outcome)
    titles = [axes.get_title() for axes in figure.axes]
    assert titles == ["before the pick", "after it: 2 unloaded, 1 fallen"]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == list(heap_view.MEANINGS)
    saved_twice(lambda: heap_view.one_pick(heap, 0, outcome))


def test_a_view_has_a_colour_for_each_meaning_and_a_still(heap, outcome):
    view = heap_view.view_heap(heap, heap_view.meanings(outcome, 0))
    mesh = view.data[0]
    assert len(mesh.x) == 8 * len(heap) and len(mesh.i) == 12 * len(heap)
    assert mesh.intensity.tolist() == [3] * 12 + [2] * 12 + [1] * 12 + [0] * 12
    assert css(COLOURS["tried"]) in {colour for _, colour in mesh.colorscale}
    assert [trace.name for trace in view.data[1:]] == list(heap_view.MEANINGS)
    assert view.picture()[:4] == b"\x89PNG" and view.picture() == view.picture()


def test_episodes_follow_the_boxes_of_the_first_heap(played, heap, outcome):
    places, numbers = played.state(1)
    corners = heap_view.corners(outcome.heap)
    assert places[[1, 3]] == pytest.approx(corners) and not numbers.any()
    assert np.ptp(places[[0, 2]], axis=1).max() == 0, "gone: of no extent"
    assert np.array_equal(played.state(9)[0], places), "after its end it stays"
    assert played.title("lowest", 0) == "lowest: 0 unloaded, 0 fallen"
    assert played.title("lowest", 5) == "lowest: 2 unloaded, 1 fallen"


def test_a_replay_has_a_stop_for_each_pick_and_needs_no_kernel(played):
    replay = heap_view.replay_heaps({"left": played, "right": played})
    assert [frame.name for frame in replay.frames] == ["0", "1"]
    assert [step["args"][0][0] for step in replay.layout.sliders[0].steps] == ["0", "1"]
    assert {trace.scene for trace in replay.data[:2]} == {"scene", "scene2"}
    assert replay.data[0].x.dtype == np.int16
    assert replay.data[0].x == pytest.approx(1000 * played.state(0)[0][..., 0].ravel(), abs=0.5)
    assert replay.layout.scene.xaxis.range[0] == 4000
    titles = [note.text for note in replay.frames[1].layout.annotations]
    assert titles == ["left: 2 unloaded, 1 fallen", "right: 2 unloaded, 1 fallen"]
    bundle = replay._repr_mimebundle_()
    assert "image/png" in bundle and len(json.dumps(bundle)) > 1000


def test_bad_input_is_refused(heap, played, outcome):
    with pytest.raises(TypeError, match="heap is 3; expected a Heap"):
        heap_view.view_heap(3)
    with pytest.raises(ValueError, match="numbers has shape"):
        heap_view.view_heap(heap, np.zeros(3, int))
    with pytest.raises(ValueError, match="height is 10"):
        heap_view.view_heap(heap, height=10)
    with pytest.raises(ValueError, match=r"len\(episodes\) is 0"):
        heap_view.replay_heaps({})
    with pytest.raises(ValueError, match="expected one heap more than picks"):
        heap_view.Played([heap], np.array([0]), [outcome])
