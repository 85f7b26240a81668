import json

import numpy as np
import pytest

from unload import Load, view


def vertices(figure) -> np.ndarray:
    mesh = figure.data[0]
    return np.column_stack([mesh.x, mesh.y, mesh.z])


def test_one_mesh_holds_all_boxes(full_load):
    figure = view(full_load)
    assert [trace.type for trace in figure.data].count("mesh3d") == 1
    corners = vertices(figure).reshape(len(full_load), 8, 3)
    low = full_load.positions - full_load.sizes / 2
    assert corners.min(axis=1) == pytest.approx(low, abs=0.01)
    assert corners.max(axis=1) == pytest.approx(low + full_load.sizes, abs=0.01)
    assert len(figure.data[0].facecolor) == 12 * len(full_load)


def test_a_thin_box_is_drawn_no_thicker_than_it_is():
    load = Load([[3.5, 1.25, 0.002]], [[1.0, 1.0, 0.004]], [0], [0])
    assert np.ptp(vertices(view(load))[:, 2]) < 0.004


def test_triangles_are_the_faces_of_their_box(boxes):
    figure = view(boxes((1.0, 0.2), (2.0, 0.2)))
    mesh, points = figure.data[0], vertices(figure)
    triangles = np.column_stack([mesh.i, mesh.j, mesh.k])
    assert set((triangles // 8).min(axis=1)) == {0, 1}
    assert (triangles // 8 == (triangles // 8)[:, :1]).all()
    a, b, c = (points[triangles[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    assert area == pytest.approx(2 * 6 * 0.388**2, rel=0.01)


def test_present_chooses_what_is_drawn(small_load):
    present = np.zeros(len(small_load), dtype=bool)
    present[[3, 7]] = True
    figure = view(small_load, present=present)
    assert len(vertices(figure)) == 16
    assert {text.split(",")[0] for text in figure.data[0].text} == {"item 3", "item 7"}


def test_packages_have_a_colour_and_a_line_in_the_legend(small_load):
    figure = view(small_load)
    names = [trace.name for trace in figure.data[1:]]
    assert names == [f"package {p}" for p in np.unique(small_load.packages)]
    colours = np.array(figure.data[0].facecolor)[::12]
    for package in np.unique(small_load.packages):
        assert len(set(colours[small_load.packages == package])) == 1
    assert len(set(colours)) == len(names)


def test_groups_differ_in_colour_and_the_later_one_wins(small_load):
    figure = view(small_load, groups={"visible": [0, 1, 2], "tried": [2, 3]})
    colours = np.array(figure.data[0].facecolor)[::12]
    assert colours[0] == colours[1] and colours[2] == colours[3]
    assert len({colours[0], colours[2], colours[4]}) == 3
    assert [trace.name for trace in figure.data[1:]] == ["visible", "tried"]
    legend = [trace.marker.color for trace in figure.data[1:]]
    assert legend == [colours[0], colours[2]]


def test_a_group_may_be_empty(small_load):
    figure = view(small_load, groups={"tried": []})
    assert len(set(figure.data[0].facecolor)) == 1 and figure.data[1].name == "tried"


def test_a_full_load_is_a_small_file_and_needs_no_network(full_load):
    content = view(full_load).to_json()
    assert len(content) < 1_500_000
    assert "http" not in content and json.loads(content)["data"]


@pytest.mark.parametrize(
    ("kwargs", "error", "message"),
    [
        ({"load": "walls"}, TypeError, "load is 'walls'; expected an unload.Load"),
        ({"present": np.ones(3, dtype=bool)}, ValueError, r"present has shape \(3,\)"),
        ({"present": 1}, ValueError, "present has shape .* dtype int64; expected"),
        ({"groups": {"a": [10**6]}}, ValueError, r"groups\['a'\] holds 1000000 to 1000000"),
        ({"groups": {"a": [-1, 3]}}, ValueError, r"groups\['a'\] holds -1 to 3; expected 0 to"),
        ({"groups": dict.fromkeys("abcde", [0])}, ValueError, "groups has the names"),
        ({"groups": [1]}, TypeError, r"groups is \[1\]; expected a dict"),
        ({"groups": {"a": [0.5]}}, TypeError, r"groups\['a'\] has dtype float64"),
        ({"groups": {"a": [True, False]}}, TypeError, r"groups\['a'\] has dtype bool"),
    ],
)
def test_bad_input_is_refused(small_load, kwargs, error, message):
    with pytest.raises(error, match=message):
        view(**({"load": small_load} | kwargs))
