"""The memory of lifts."""

import json

import numpy as np
import pybullet
import pytest

from unload import task
from unload.physics.bullet import SETTINGS, World
from unload.physics.full import LIFTS, LocalPhysics
from unload.physics.situation import Surroundings
from unload.physics.table import HELD_DOWN, LiftTable
from unload.support import files


@pytest.fixture(scope="module")
def situations(full_load):
    """Situations of a full container with at most two boxes on top, and others."""
    surroundings = Surroundings(full_load, np.ones(len(full_load), dtype=bool))
    return [surroundings.situation(item) for item in range(0, len(full_load), 7)]


def test_table_gives_what_local_physics_gives(situations):
    local, table = LocalPhysics(), LiftTable()
    light = [each for each in situations if each.on_top < HELD_DOWN]
    assert len(light) > 20
    for situation in light:
        distance = local.simulate(situation)
        assert table.lift(situation) == distance  # filled
        assert table.lift(situation) == distance  # looked up
    assert 0 < len(table) <= len(light)
    local.close()


def test_an_interrupted_lift_leaves_nothing_in_the_way(situations, monkeypatch):
    table = LiftTable()
    one, *others = (each for each in situations if each.on_top < HELD_DOWN)

    def interrupted(world, body):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(World, "pull", interrupted)
        table.lift(one)
    fresh = LiftTable()
    for situation in (one, *others):
        assert table.lift(situation) == fresh.lift(situation)


def test_a_closed_table_lifts_again(situations):
    table = LiftTable()
    table.close()  # nothing to free
    one, other, *_ = (each for each in situations if each.on_top < HELD_DOWN)
    distance = table.lift(one)
    world = table._world
    table.close()
    with pytest.raises(pybullet.error):
        world.pose(0)
    assert table.lift(one) == distance
    assert table.lift(other) == LiftTable().lift(other)


def test_boxes_under_three_others_are_held_down_in_local_physics_too(situations):
    local, table = LocalPhysics(), LiftTable()
    heavy = [each for each in situations if each.on_top >= HELD_DOWN][::3]
    assert len(heavy) > 15
    for situation in heavy:
        assert table.lift(situation) == 0
        assert local.simulate(situation) < task.LIFT_THRESHOLD
    assert len(table) == 0
    local.close()


def test_saved_table_answers_the_same_without_lifting(situations, tmp_path, monkeypatch):
    table = LiftTable()
    distances = [table.lift(each) for each in situations[:20]]
    table.save(tmp_path / "lifts.npz")
    read = LiftTable.load(tmp_path / "lifts.npz")
    monkeypatch.setattr("unload.physics.table.lift", None)
    assert [read.lift(each) for each in situations[:20]] == distances
    read.save(tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == (tmp_path / "lifts.npz").read_bytes()


def test_table_of_another_physics_is_refused(situations, tmp_path):
    table = LiftTable()
    table.lift(situations[0])
    table.save(tmp_path / "lifts.npz")
    arrays = files.read_arrays(tmp_path / "lifts.npz")
    arrays["settings"] = np.array(json.dumps(SETTINGS | {"friction": 0.7}))
    files.write_arrays(tmp_path / "other.npz", arrays)
    with pytest.raises(ValueError, match="friction is 0.7 there and 0.5 here"):
        LiftTable.load(tmp_path / "other.npz")


def test_damaged_and_foreign_files_are_refused(tmp_path):
    (tmp_path / "damaged.npz").write_bytes(b"no zip file")
    with pytest.raises(ValueError, match="damaged.npz"):
        LiftTable.load(tmp_path / "damaged.npz")
    files.write_arrays(tmp_path / "foreign.npz", {"x": np.zeros(3)})
    with pytest.raises(ValueError, match="expected a lift table"):
        LiftTable.load(tmp_path / "foreign.npz")
    with pytest.raises(FileNotFoundError):
        LiftTable.load(tmp_path / "missing.npz")


def test_shipped_table_fits_this_physics():
    assert len(LiftTable.load(LIFTS)) > 1000
