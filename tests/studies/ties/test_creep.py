"""Boxes that creep in a world that goes on."""

import numpy as np
import pandas as pd
import pytest

from studies.seamless.jams import Case, load_of
from studies.ties import creep


@pytest.mark.pybullet
def test_a_world_settles_and_goes_on(monkeypatch):
    monkeypatch.setattr(creep, "CONTAINER_PICKS", 3)
    world = creep.World(0, walls=1)
    played = creep.play(world)
    offsets, touched = np.array(played["offsets"]), np.array(played["touched"])
    load = load_of(Case(world.load, world.walls))
    assert offsets.shape == (4, len(load), 3) and touched.shape == (len(load),)
    assert 50 < np.abs(offsets[0]).max() < 5000, "µm, before any pick"
    top = load.positions[:, 2] == load.positions[:, 2].max()
    assert top[touched == 0].any(), "the highest box is picked first"
    assert (touched <= 2).all() and 3 <= (touched >= 0).sum() < len(load) / 2
    still = touched < 0
    assert (offsets[1:, still] != offsets[0, still]).any(), "nobody touches them, and they creep"


def test_the_order_of_equals_is_followed_among_untouched_boxes():
    """Offsets of a world that is made up: along x kept, along y reversed at each pick."""
    world = creep.World(0)
    count = len(load_of(Case(0, 3)))
    offsets = np.tile(np.random.default_rng(0).normal(size=(count, 3)), (3, 1, 1)) * 1000
    offsets[1, :, 1] *= -1
    offsets[1, :, 0] += 5000  # of all boxes alike, which is not counted
    touched = np.full(count, -1)
    rows = pd.DataFrame(creep.rows(world, {"offsets": offsets, "touched": touched}))
    found = rows.set_index(["lag", "axis"])
    assert found.loc[(1, "x"), "spearman"] == pytest.approx(1)
    assert found.loc[(1, "y"), "spearman"] == pytest.approx(-1)
    assert found.loc[(2, "y"), "spearman"] == pytest.approx(1) and found.loc[(2, "z"), "rms"] == 0
    assert found.loc[(1, "x"), "rms"] == pytest.approx(0)
    assert 1 < found.loc[(1, "y"), "rms"] < 2, "mm, twice the spread within a group"
    assert found.loc[(1, "x"), "boxes"] == count
    touched[:] = 0
    assert not creep.rows(world, {"offsets": offsets, "touched": touched})
