import base64
import io
import json

import numpy as np
import pytest
from IPython.core.formatters import DisplayFormatter
from matplotlib.colors import to_hex
from matplotlib.image import imread

from unload import Load, view
from unload.load.picture import COLOURS, EYE
from unload.load.view import _OTHER_COLOURS, _PLOTLY_MIMETYPE, _short


def vertices(trace) -> np.ndarray:
    return np.column_stack([trace.x, trace.y, trace.z])


def items(trace) -> list[int]:
    """The items that a mesh draws, as its labels name them."""
    return trace.customdata[::8, 0].tolist()


def test_a_mesh_holds_the_boxes_of_one_colour(full_load):
    figure = view(full_load)
    assert {trace.type for trace in figure.data} == {"mesh3d"}
    assert len(figure.data) == len(np.unique(full_load.packages)), "no line for other boxes"
    assert sorted(sum(map(items, figure.data), [])) == list(range(len(full_load)))
    for trace in figure.data:
        corners = vertices(trace).reshape(-1, 8, 3)
        sizes = full_load.sizes[items(trace)]
        low = full_load.positions[items(trace)] - sizes / 2
        assert corners.min(axis=1) == pytest.approx(low, abs=0.01)
        assert corners.max(axis=1) == pytest.approx(low + sizes, abs=0.01)


def test_triangles_are_the_faces_of_their_box(boxes):
    mesh = view(boxes((1.0, 0.2), (2.0, 0.2))).data[0]
    assert mesh.i.dtype == np.int16, "of 16 vertices"
    assert [_short(np.array([2**15 - less])).dtype for less in (1, 0)] == [np.int16, np.int32]
    points = vertices(mesh)
    triangles = np.column_stack([mesh.i, mesh.j, mesh.k])
    assert set((triangles // 8).min(axis=1)) == {0, 1}
    assert (triangles // 8 == (triangles // 8)[:, :1]).all()
    a, b, c = (points[triangles[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    assert area == pytest.approx(2 * 6 * 0.388**2, rel=0.01)


@pytest.mark.parametrize("length", [7.0, 14.0])
def test_the_container_has_its_true_proportions(boxes, length):
    load = boxes((1.0, 0.2))
    figure = view(Load(load.positions, load.sizes, container=(length, 2.5, 2.5)))
    scene = figure.layout.scene
    assert figure.layout.height == 520
    drawn = np.array([scene.aspectratio[axis] for axis in "xyz"])
    assert scene.aspectmode == "manual"
    assert drawn == pytest.approx([2.8, 2.8 * 2.5 / length, 2.8 * 2.5 / length])
    ranges = [np.ptp(scene[f"{axis}axis"].range) for axis in "xyz"]
    assert ranges == pytest.approx([length, 2.5, 2.5])
    eye = np.array([scene.camera.eye[axis] for axis in "xyz"])  # from the container's middle
    if length == 7:
        assert eye * 2.5 + (3.5, 1.25, 1.25) == pytest.approx(EYE)
    else:
        assert eye[0] * drawn[0] / 2.8 > drawn[0] / 2, "from outside"
        assert figure.picture() != view(load).picture()


def test_present_chooses_what_is_drawn(small_load):
    present = np.zeros(len(small_load), dtype=bool)
    present[[3, 7]] = True
    figure = view(small_load, present=present)
    assert sorted(sum(map(items, figure.data), [])) == [3, 7]
    assert len(view(small_load, present=np.zeros_like(present)).data) == 0


def test_of_two_groups_the_later_one_wins_and_one_may_be_empty(small_load):
    groups = {"visible": [0, 1, 2], "tried": [2, 3], "failed": []}
    others = dict(zip("abcd", ([4], [5], [6], [7])))
    figure = view(small_load, groups=groups | others)
    shown = {trace.name: items(trace) for trace in figure.data}
    rest = list(range(8, len(small_load)))
    assert shown == {"visible": [0, 1], "tried": [2, 3], "failed": [], **others, "unseen": rest}
    colours = COLOURS | dict(zip(others, _OTHER_COLOURS))
    for trace in figure.data:
        assert trace.color == to_hex(colours[trace.name])


def test_an_order_shows_its_first_ten_picks(full_load):
    order = np.arange(880, 860, -1)
    figure = view(full_load, order=order)
    names = [f"pick {number}" for number in range(1, 11)] + ["picked later"]
    assert [trace.name for trace in figure.data] == names
    assert [items(trace) for trace in figure.data[:10]] == [[item] for item in order[:10]]
    assert len({trace.color for trace in figure.data}) == 11
    assert len(view(full_load, order=order[:2]).data) == 3
    assert imread(io.BytesIO(figure.picture())).shape[2] >= 3


def test_pointing_at_a_box_names_it_and_its_edges(small_load):
    trace = view(small_load, groups={"failed": [5]}).data[0]
    millimetres = np.rint(1000 * small_load.sizes[5]).tolist()
    assert trace.customdata[3].tolist() == [5, small_load.packages[5], *millimetres]
    assert "item %{customdata[0]}" in trace.hovertemplate
    assert "%{fullData.name}" in trace.hovertemplate and trace.name == "failed"


def test_ipython_displays_a_figure_and_a_picture_in_little_room_and_without_a_network(full_load):
    bundle, _ = DisplayFormatter().format(view(full_load, height=300))
    assert set(bundle) == {"image/png", "text/plain", _PLOTLY_MIMETYPE}
    assert sum(len(json.dumps(content)) for content in bundle.values()) < 1_000_000
    assert "http" not in json.dumps(bundle[_PLOTLY_MIMETYPE]) and bundle[_PLOTLY_MIMETYPE]["data"]
    picture = base64.b64decode(bundle["image/png"])
    assert picture.startswith(b"\x89PNG")
    assert int.from_bytes(picture[16:20]) == 800  # pixels wide
    assert int.from_bytes(picture[20:24]) == 300  # and high
    emptied = view(full_load, np.zeros(len(full_load)))
    assert "image/png" in emptied._repr_mimebundle_()


@pytest.mark.parametrize(
    ("kwargs", "error", "message"),
    [
        ({"load": "walls"}, TypeError, "load is 'walls'; expected an unload.Load"),
        ({"present": np.ones(3, dtype=bool)}, ValueError, r"present has shape \(3,\)"),
        ({"groups": {"a": [-1, 3]}}, ValueError, r"groups\['a'\] holds -1 to 3; expected 0 to 90$"),
        ({"groups": dict.fromkeys("abcde", [0])}, ValueError, "groups has the names"),
        ({"groups": {}, "order": [0]}, ValueError, "groups and order are given; expected one"),
        ({"order": [91]}, ValueError, "order holds 91 to 91; expected 0 to 90"),
        ({"groups": [1]}, TypeError, r"groups is \[1\]; expected a dict"),
        ({"height": 49}, ValueError, "height is 49; expected an integer >= 50 and <= 5000"),
    ],
)
def test_bad_input_is_refused(small_load, kwargs, error, message):
    with pytest.raises(error, match=message):
        view(**({"load": small_load} | kwargs))
