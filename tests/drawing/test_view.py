import base64
import io
import json

import numpy as np
import plotly.graph_objects as go
import pytest
from IPython.core.formatters import DisplayFormatter
from matplotlib.colors import to_hex
from matplotlib.image import imread
from plotly.io import renderers

from unload import Load, view
from unload.drawing.picture import COLOURS
from unload.drawing.view import _OTHER_COLOURS, _PLOTLY_MIMETYPE, _short


def items(trace) -> list[int]:
    """The items that a mesh draws, as its labels name them."""
    return trace.customdata[::8, 0].tolist()


def test_a_mesh_holds_the_boxes_of_one_colour(full_load):
    figure = view(full_load)
    assert {trace.type for trace in figure.data} == {"mesh3d"}
    assert len(figure.data) == len(np.unique(full_load.packages)), "no line for other boxes"
    assert sorted(sum(map(items, figure.data), [])) == list(range(len(full_load)))
    for trace in figure.data:
        corners = np.column_stack([trace.x, trace.y, trace.z]).reshape(-1, 8, 3)
        sizes = full_load.sizes[items(trace)]
        low = full_load.positions[items(trace)] - sizes / 2
        assert corners.min(axis=1) == pytest.approx(low, abs=0.01)
        assert corners.max(axis=1) == pytest.approx(low + sizes, abs=0.01)


@pytest.mark.parametrize("length", [7.0, 14.0])
def test_the_container_has_its_true_proportions(boxes, length):
    load = boxes((1.0, 0.2))
    figure = view(Load(load.positions, load.sizes, container=(length, 2.5, 2.5)))
    scene = figure.layout.scene
    drawn = np.array([scene.aspectratio[axis] for axis in "xyz"])
    assert scene.aspectmode == "manual"
    assert drawn == pytest.approx([2.8, 2.8 * 2.5 / length, 2.8 * 2.5 / length])
    ranges = [np.ptp(scene[f"{axis}axis"].range) for axis in "xyz"]
    assert ranges == pytest.approx([length, 2.5, 2.5])
    assert scene.camera.eye.x * drawn[0] / 2.8 > drawn[0] / 2, "from outside"
    assert (figure.picture() == view(load).picture()) == (length == 7), "the still picture, too"


def test_of_two_groups_the_later_one_wins_and_one_may_be_empty(small_load):
    groups = {"visible": [0, 1, 2], "tried": [2, 3], "failed": []}
    others = dict(zip("abcd", ([4], [5], [6], [7])))
    present = np.arange(len(small_load)) != 20
    figure = view(small_load, present, groups=groups | others)
    shown = {trace.name: items(trace) for trace in figure.data}
    rest = [item for item in range(8, len(small_load)) if item != 20]
    assert shown == {"visible": [0, 1], "tried": [2, 3], "failed": [], **others, "unseen": rest}
    colours = COLOURS | dict(zip(others, _OTHER_COLOURS))
    for trace in figure.data:
        assert trace.color == to_hex(colours[trace.name])


def test_the_first_ten_picks_of_an_order_have_their_numbers(small_load):
    figure = view(small_load, order=np.arange(20)[::-1])
    shown = {trace.name: items(trace) for trace in figure.data}
    assert [*shown] == [*(f"pick {number}" for number in range(1, 11)), "picked later"]
    assert [shown[f"pick {number}"] for number in (1, 2, 10)] == [[19], [18], [10]]


def test_ipython_displays_a_figure_and_a_picture_in_little_room_and_without_a_network(full_load):
    bundle, _ = DisplayFormatter().format(view(full_load, height=300))
    assert set(bundle) == {"image/png", "text/plain", _PLOTLY_MIMETYPE}
    assert sum(len(json.dumps(content)) for content in bundle.values()) < 1_000_000
    assert "http" not in json.dumps(bundle[_PLOTLY_MIMETYPE]) and bundle[_PLOTLY_MIMETYPE]["data"]
    picture = base64.b64decode(bundle["image/png"])
    assert imread(io.BytesIO(picture)).shape[:2] == (300, 800)


def test_a_script_is_told_how_to_see_a_view(small_load, monkeypatch):
    """plotly shows nothing where it finds no browser, and says nothing."""
    figure = view(small_load)
    assert "show()" in repr(figure) and len(repr(figure)) < 100
    shown = []
    monkeypatch.setattr(go.Figure, "show", lambda figure, *args, **kwargs: shown.append(kwargs))
    monkeypatch.setattr(renderers, "default", "")
    with pytest.raises(RuntimeError, match=r"no browser here; expected one of them, or write_html"):
        figure.show()
    figure.show(renderer="png")
    monkeypatch.setattr(renderers, "default", "browser")
    figure.show()
    assert shown == [{"renderer": "png"}, {}]


@pytest.mark.parametrize(
    ("kwargs", "error", "message"),
    [
        ({"groups": {"a": [-1, 3]}}, ValueError, r"groups\['a'\] holds -1 to 3; expected 0 to 90$"),
        ({"groups": dict.fromkeys("abcde", [0])}, ValueError, "groups has the names"),
        ({"groups": {}, "order": [0]}, ValueError, "groups and order are given; expected one"),
        ({"height": 49}, ValueError, "height is 49; expected an integer >= 50 and <= 5000"),
    ],
)
def test_bad_input_is_refused(small_load, kwargs, error, message):
    with pytest.raises(error, match=message):
        view(**({"load": small_load} | kwargs))


def test_numbers_take_few_bytes_as_long_as_they_fit():
    for most, kind in ((2**15 - 1, np.int16), (2**15, np.int32)):
        numbers = _short(np.array([0, most]))
        assert numbers.dtype == kind and numbers.tolist() == [0, most]
