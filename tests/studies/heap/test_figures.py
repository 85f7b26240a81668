"""The figures of heaps."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from studies.heap import figures, picture
from studies.heap.table import read_heap_table
from unload.load.picture import COLOURS


def test_the_throughput_draws_its_data():
    """From data/ where it is read: dots at the values of the table, and all their names."""
    table = read_heap_table()
    (curves,) = figures.throughput_falls().axes
    named = {line.get_label(): line for line in curves.lines}
    learned = table[table["policy"] == "learned"].sort_values("falls_weight")
    assert named["learned"].get_xdata().tolist() == learned["falls"].tolist()
    assert named["learned"].get_ydata().tolist() == learned["boxes"].tolist()
    texts = {text.get_text() for text in curves.texts}
    assert texts == {*figures.RULES, *(f"λ = {weight:g}" for weight in learned["falls_weight"])}
    assert {text.get_text() for text in curves.get_legend().get_texts()} == set(figures.LINES)


def test_missing_data_names_the_command_that_makes_it(tmp_path):
    with pytest.raises(FileNotFoundError, match="python -m studies heap makes it"):
        figures.throughput_falls(tmp_path)


def test_corners_are_those_of_turned_boxes(heap):
    corners = picture.corners(heap)
    seam = picture.SEAM
    assert np.ptp(corners[0], axis=0) == pytest.approx([0.4 - seam] * 3)
    wide = (0.4 - seam) * 2**0.5
    assert np.ptp(corners[3], axis=0) == pytest.approx([wide, wide, 0.4 - seam])
    assert corners.mean(axis=1) == pytest.approx(heap.positions)


def test_nearer_boxes_are_painted_later(heap):
    """Box 2 is nearer to the eye than box 0, and its top is brighter than its sides."""
    axes = plt.figure().add_subplot()
    colours = np.array([picture.MEANINGS[name] for name in ("comes along", "is dragged")])
    picture.draw_heap(axes, heap.only(np.array([2, 0])), colours)
    painted = axes.collections[0].get_facecolors()[:, :3]
    assert len(painted) == 6, "three faces of a box are turned to the eye"
    dragged, along = (np.array(COLOURS[name]) for name in ("tried", "liftable"))
    own = [np.linalg.norm(face / face.max() - dragged / dragged.max()) < 0.02 for face in painted]
    assert own == [True] * 3 + [False] * 3
    assert painted[3:].max() <= along.max() + 1e-9
