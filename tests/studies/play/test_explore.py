import base64

import ipywidgets as widgets
import matplotlib.pyplot as plt
import pytest

from studies.play.explore import Explore

WIDGET = "application/vnd.jupyter.widget-view+json"


@pytest.fixture
def explored():
    """A line whose end is moved by a slider, and the values that it was drawn with."""
    seen = []

    def draw(end, name):
        seen.append((end, name))
        figure, axes = plt.subplots(figsize=(1, 1))
        axes.plot([0, 1], [0, end])
        axes.set(title=name, ylim=(0, 10))
        return figure

    controls = {"end": widgets.IntSlider(3, max=9), "name": widgets.ToggleButtons(options="ab")}
    return Explore(draw, **controls), controls, seen


def test_a_change_is_drawn_at_once(explored):
    view, controls, seen = explored
    before = bytes(view.picture.value)
    controls["end"].value = 7
    controls["name"].value = "b"
    assert seen == [(3, "a"), (7, "a"), (7, "b")]
    assert view.picture.value != before
    controls["end"].value, controls["name"].value = 3, "a"
    assert view.picture.value == before


def test_where_no_kernel_runs_a_picture_stands(explored):
    view, *_ = explored
    data = view._repr_mimebundle_()
    assert WIDGET in data
    assert base64.b64decode(data["image/png"]) == view.picture.value
    assert bytes(view.picture.value).startswith(b"\x89PNG")


def test_no_figure_is_left_open_to_be_shown_twice(explored):
    assert not plt.get_fignums()
