"""The figures of heaps."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from studies.heap import figures
from studies.heap.table import SHOWN_WEIGHT, read_heap_table
from unload.load.picture import COLOURS


def test_every_figure_draws_its_data():
    """From data/ where it is read: dots at the values of the table, and all their names."""
    table = read_heap_table()
    shown = table[table["falls_weight"] == SHOWN_WEIGHT].set_index("policy")
    axes = figures.policies().axes
    assert [text.get_text() for text in axes[0].get_yticklabels()] == list(shown.index)
    for panel, measure in zip(axes, ("boxes", "falls", "net")):
        values = [line.get_xdata() for line in panel.lines]
        assert [value[0] for value in values[1::2]] == shown[measure].tolist()
        ends = shown[[f"{measure}_low", f"{measure}_high"]].to_numpy().tolist()
        assert [list(value) for value in values[::2]] == ends
    (curves,) = figures.throughput_falls().axes
    named = {line.get_label(): line for line in curves.lines}
    learned = table[table["policy"] == "learned"].sort_values("falls_weight")
    assert named["learned"].get_xdata().tolist() == learned["falls"].tolist()
    assert named["learned"].get_ydata().tolist() == learned["boxes"].tolist()
    texts = {text.get_text() for text in curves.texts}
    assert texts == {*figures.RULES, *(f"λ = {weight:g}" for weight in learned["falls_weight"])}
    assert {text.get_text() for text in curves.get_legend().get_texts()} == set(figures.LINES)


def test_missing_data_names_the_command_that_makes_it(tmp_path):
    for draw in (figures.policies, figures.throughput_falls):
        with pytest.raises(FileNotFoundError, match="python -m studies heap makes it"):
            draw(tmp_path)


def test_corners_are_those_of_turned_boxes(heap):
    corners = figures.corners(heap)
    seam = figures.SEAM
    assert np.ptp(corners[0], axis=0) == pytest.approx([0.4 - seam] * 3)
    wide = (0.4 - seam) * 2**0.5
    assert np.ptp(corners[3], axis=0) == pytest.approx([wide, wide, 0.4 - seam])
    assert corners.mean(axis=1) == pytest.approx(heap.positions)


def test_an_expected_fate_is_the_share_of_its_colour(heap, outcome):
    """Box 0 is dragged, 3 hidden; 1 falls for certain, and 2 comes in half of the cases."""
    chances = np.array([[1.0, 0], [0, 1], [0.5, 0]])
    figure = figures.expected_fates(heap, 0, np.array([0, 1, 2]), chances, outcome)
    left, right = (
        {tuple(np.round(c[:3] / c[:3].max(), 2)) for c in axes.collections[0].get_facecolors()}
        for axes in figure.axes[:2]
    )

    def tint(colour):
        return tuple(np.round(colour / colour.max(), 2))

    stays, comes, falls, dragged = map(np.array, figures.MEANINGS.values())
    assert left == {tint(c) for c in (dragged, falls, (stays + comes) / 2, stays)}
    assert right == {tint(c) for c in (dragged, falls, comes, stays)}
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names == list(figures.MEANINGS)


def test_episodes_are_drawn_before_their_first_middle_and_last_pick(heap, outcome):
    one = [heap, outcome.heap], np.array([0]), [outcome]
    titles = [panel.get_title() for panel in figures.episodes({"lowest": one}).axes]
    assert titles == ["lowest, pick 1: 0 unloaded, 0 fallen"] * 3


def test_nearer_boxes_are_painted_later(heap):
    """Box 2 is nearer to the eye than box 0, and its top is brighter than its sides."""
    axes = plt.figure().add_subplot()
    colours = np.array([figures.MEANINGS[name] for name in ("comes along", "is dragged")])
    figures.draw_heap(axes, heap.only(np.array([2, 0])), colours)
    painted = axes.collections[0].get_facecolors()[:, :3]
    assert len(painted) == 6, "three faces of a box are turned to the eye"
    dragged, along = (np.array(COLOURS[name]) for name in ("tried", "liftable"))
    own = [np.linalg.norm(face / face.max() - dragged / dragged.max()) < 0.02 for face in painted]
    assert own == [True] * 3 + [False] * 3
    assert painted[3:].max() <= along.max() + 1e-9
