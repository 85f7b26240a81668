"""Pictures of a deadlock."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import to_rgb

from unload import stack_load
from unload.load.colours import COLOURS
from unload.reproduce.figures.deadlock import draw_picks, draw_stuck


def test_picks_are_drawn_by_how_they_ended():
    figure, axes = plt.subplots()
    draw_picks(axes, np.array([7, 7, 9]), np.array([False, False, True]))
    failed, unloaded = axes.collections
    assert failed.get_label() == "failed"
    assert failed.get_offsets().tolist() == [[0, 7], [1, 7]]
    assert unloaded.get_offsets().tolist() == [[2, 9]]


def test_the_wall_of_a_stuck_item():
    load = stack_load(np.random.default_rng(0), walls=2)
    present = np.ones(len(load), bool)
    wall = np.flatnonzero(load.walls == 1)
    present[wall[-1]] = False
    figure, axes = plt.subplots()
    draw_stuck(axes, load, present, int(wall[0]), wall[1:3])
    colours = [to_rgb(box.get_facecolor()) for box in axes.patches]
    assert len(colours) == len(wall) - 1
    assert colours.count(COLOURS["blocked"]) == 1
    assert colours.count(COLOURS["on top of it"]) == 2
    assert len(axes.get_legend().get_texts()) == 3
