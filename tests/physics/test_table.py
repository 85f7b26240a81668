"""Tables of lifts, and what they say without one."""

from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import islice
from unittest.mock import Mock

import numpy as np
import pytest

from tests.load.walls import KINDS, own_load
from unload import task
from unload.physics.local import LocalPhysics
from unload.physics.situation import Situation, Surroundings
from unload.physics.table import (
    FREE_LIFT,
    HELD_DOWN,
    LIFTS_FILE,
    LiftTable,
    TablePhysics,
    held_by_rule,
    hopeless,
)
from unload.support import files


@pytest.mark.pybullet
@pytest.mark.parametrize("kind", KINDS)
def test_every_box_with_nothing_on_top_moves_equally_far(kind, rng):
    """2,000 boxes of four kinds of loads, of which a part has been unloaded."""
    local, asked = LocalPhysics(), 0
    while asked < 500:
        load = own_load(rng, kind)
        around = Surroundings(load, rng.random(len(load)) < rng.choice([1.0, 0.7, 0.4]))
        for item in rng.permutation(np.flatnonzero(around.present))[:200].tolist():
            if not around.on_top(item) and asked < 500:
                assert local.simulate(around.situation(item)) == FREE_LIFT
                asked += 1


SIDE = 400_000  # µm, edges of the boxes of a pile


def pile(*centres: tuple[float, float], floor: int | None = None, sides=()) -> Situation:
    """A cube and others on it, whose centres are given in its half edges, along x and y."""
    places = [(x * SIDE / 2, y * SIDE / 2, SIDE) for x, y in centres]
    boxes = np.array([(*place, SIDE, SIDE, SIDE) for place in [(0, 0, 0), *places]], np.int32)
    return Situation(boxes, len(boxes), floor, sides)


@pytest.mark.parametrize("floor", [None, -SIDE // 2])
@pytest.mark.parametrize("sides", [(), (-SIDE,), (-SIDE, SIDE)])
@pytest.mark.parametrize(
    ("centres", "held"),
    [
        ([(0.31, -0.31)], True),
        ([(0.33, -0.33)], False),
        ([(0.44, 0)], True),
        ([(0.46, 0)], False),
        ([(0, -0.46)], False),
        ([(0.44, 0), (-0.3, 0.3)], True),
        ([(0.46, 0), (-0.3, 0)], False),
        ([(-0.3, 0), (0, 0.46)], False),
    ],
    ids=str,
)
def test_boxes_on_the_middle_hold_a_box_down_without_a_simulation(
    centres, held, floor, sides, monkeypatch
):
    asked = Mock(return_value=0.123)
    monkeypatch.setattr(LocalPhysics, "_pull", asked)
    situation = pile(*centres, floor=floor, sides=sides)
    assert TablePhysics().simulate(situation) == (0.0 if held else 0.123)
    assert asked.called != held
    assert TablePhysics(exact=True).simulate(situation) == 0.123
    known = LiftTable()
    known.add(situation, 0.3)
    assert TablePhysics(known).simulate(situation) == 0.3, "the table comes first"
    assert TablePhysics(known, held_down=1).simulate(situation) == 0, "it lies on another one"


def between(*others: tuple[float, float, float], centres=((0.0, 0.9),), sides=()) -> Situation:
    """A pile and more cubes beside it, whose centres are given in half edges, too."""
    beside = [(x * SIDE / 2, y * SIDE / 2, z * SIDE / 2, SIDE, SIDE, SIDE) for x, y, z in others]
    boxes = np.array([*pile(*centres).boxes, *beside]).astype(np.int32)
    return Situation(boxes, 1 + len(centres), None, sides)


LEFT, RIGHT = (0, -2, 0), (0, 2, 0)


@pytest.mark.parametrize(
    ("situation", "held"),
    [
        (between(LEFT, RIGHT), True),
        (between(LEFT, RIGHT, centres=[(0.45, 1.0)]), True),
        (between(LEFT, RIGHT, centres=[(0.46, 0.9)]), False),
        (between(LEFT, RIGHT, centres=[(0, 1.01)]), False),
        (between(LEFT, RIGHT, centres=[(0, 0.45), (0, 0.99)]), True),
        (between(LEFT, centres=[(0, 0.45), (0, 0.99)], sides=(SIDE // 2,)), True),
        (between(LEFT, centres=[(0, 0.45), (0, 1.01)], sides=(SIDE // 2,)), False),
        (between(LEFT, RIGHT, centres=[(0.6, 0.9), (0.6, 0.9)]), False),
        (between(LEFT, RIGHT, centres=[(0.6, 0.9), (-0.6, 0.9)]), False),
        (between(LEFT), False),
        (between(), False),
        (between(LEFT, sides=(SIDE // 2,)), True),
        (between(sides=(-SIDE // 2, SIDE // 2)), True),
        (between(LEFT, sides=(SIDE,)), False),
        (between(LEFT, sides=(-SIDE // 2,)), False),
        (between(LEFT, (0, 2.01, 0)), False),
        (between(LEFT, (0.98, 2, 0)), True),
        (between(LEFT, (1.02, 2, 0)), False),
        (between(LEFT, (0, 2, -1.02)), False),
        (between(LEFT, (0, 2, -1.4), (0, 2, 1.4)), True),
        (between(LEFT, (2.2, 2, 0)), False),
    ],
)
def test_between_others_a_box_is_held_wherever_the_load_is_above_it(situation, held):
    assert held_by_rule(np.frombuffer(situation.key, np.int32)) == held


@pytest.mark.parametrize(("edge", "held"), [(150_000, True), (149_999, False)])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_small_box_is_not_held_down_for_certain(axis, edge, held):
    small = pile((0.0, 0.0))
    small.boxes[0, 3 + axis] = edge
    assert held_by_rule(np.frombuffer(small.key, np.int32)) == held


@pytest.mark.parametrize(("height", "held"), [(0.25, True), (0.24, False)])
def test_a_flat_box_tips_within_the_gaps(height, held):
    boxes = np.array([[0, 0, 0], [0, 0.45, 0.5], [0, -1, 0], [0, 1, 0]])
    rows = np.hstack([boxes * (1, 1, height), np.ones((4, 3)) * (1, 1, height)]) * SIDE
    flat = Situation(np.rint(rows).astype(np.int32), 2, None, ())
    assert held_by_rule(np.frombuffer(flat.key, np.int32)) == held


@pytest.mark.parametrize(
    ("moved", "speed", "left", "given_up"),
    [
        # After 32 of 72 steps a free rise takes 0.1415 m.
        (0.0, 0.0, 1 / 6, True),
        (0.03, 0.17, 1 / 6, True),
        (0.03, 0.18, 1 / 6, False),
        # After 16 the acceleration so far counts: 2.22 m/s² make 0.1 m, and half of that 0.05 m.
        (0.005, 0.148, 7 / 30, False),
        (0.0025, 0.075, 7 / 30, False),
        (0.0025, 0.073, 7 / 30, True),
        (0.049, 0.0, 7 / 30, True),
    ],
)
def test_what_cannot_or_will_hardly_rise_is_hopeless(moved, speed, left, given_up):
    assert hopeless(moved, speed, left) == given_up


def simulated_and_said(engine: str) -> Iterator[tuple[float, float]]:
    """Distances by ``LocalPhysics`` and by an empty table, of lifts that no rule answers.

    Boxes of layered walls under one or two others that do not lie on their middle.
    """
    rng, local = np.random.default_rng(5), LocalPhysics(engine)
    load = own_load(rng, "continuous sizes")
    around = Surroundings(load, rng.random(len(load)) < 0.6)
    for item in np.flatnonzero(around.present).tolist():
        situation, table = around.situation(item), LiftTable(engine)
        answer = TablePhysics(table).simulate(situation)
        if len(table):
            yield local.simulate(situation), answer


@pytest.mark.parametrize("engine", [pytest.param("pybullet", marks=pytest.mark.pybullet), "mujoco"])
def test_a_lift_that_is_given_up_or_cheaper_has_the_same_answer(engine):
    pairs = np.array([*islice(simulated_and_said(engine), 40)])
    distances, said = pairs.T
    given_up = said == 0
    assert 3 < given_up.sum() < len(pairs) - 3
    assert np.array_equal(said >= task.LIFT_THRESHOLD, distances >= task.LIFT_THRESHOLD)
    assert said[~given_up] == pytest.approx(distances[~given_up], abs=0.01)
    # MuJoCo's is the same simulation; PyBullet's has one body instead of many, and other bits.
    same = np.array_equal(said[~given_up], distances[~given_up])
    assert same == (engine == "mujoco")


@pytest.mark.pybullet
def test_a_lift_close_to_the_threshold_is_simulated_in_full(monkeypatch):
    monkeypatch.setattr("unload.physics.local._CLOSE", 1.0)
    for distance, said in islice(simulated_and_said("pybullet"), 10):
        assert said == distance


@pytest.mark.pybullet
def test_shipped_table_fits_this_physics(situations):
    shipped, local = LiftTable.load(LIFTS_FILE), LocalPhysics()
    assert len(shipped) > 1000
    light = [each for each in situations if 0 < each.on_top < HELD_DOWN]
    known = [each for each in light if shipped.find(each) is not None]
    assert len(known) > 20
    assert all(shipped.find(each) == local.simulate(each) for each in known)


def free_box(number: int) -> Situation:
    """One of many different boxes that nothing touches."""
    return Situation(np.array([[0, 0, 0, 400_000, 400_000, number]], np.int32), 1, None, ())


def table_of(numbers: Iterable[int]) -> LiftTable:
    """A table of lifts, that of box k over k mm."""
    table = LiftTable()
    for number in numbers:
        table.add(free_box(number), number / 1000)
    return table


def test_entries_are_sorted_whatever_the_order_in_which_they_came(rng, tmp_path):
    table, other = table_of(range(50)), table_of(rng.permutation(50).tolist())
    digests, micrometres = table.entries
    assert (digests[1:] > digests[:-1]).all() and set(micrometres) == set(range(0, 50_000, 1000))
    table.save(tmp_path / "lifts.npz")
    other.save(tmp_path / "other.npz")
    assert (tmp_path / "lifts.npz").read_bytes() == (tmp_path / "other.npz").read_bytes()
    read = LiftTable.load(tmp_path / "lifts.npz")
    read.add(free_box(50), 0.05)
    assert len(read) == 51 and all(read.find(free_box(k)) == k / 1000 for k in range(51))


def test_files_that_are_no_lift_table_are_refused(tmp_path):
    path = tmp_path / "other.npz"
    files.write_arrays(path, {"weights": np.zeros(3)})
    with pytest.raises(ValueError, match=r"other.npz holds \['weights'\]; expected a lift table"):
        LiftTable.load(path)
    np.savez(path, weights=np.zeros(3))
    with pytest.raises(ValueError, match="other.npz was changed or damaged: .*, expected None"):
        LiftTable.load(path)


def test_threads_find_and_add_at_the_same_time():
    """Nobody meets a wrong distance, and none is lost.

    What is known keeps its distance.
    """
    table = LiftTable()

    def work(first: int) -> list:
        wrong = []
        for number in range(first, 6000, 4):
            table.add(free_box(number), number / 1000)
            for known in range(first, number, 997):
                if table.find(free_box(known)) not in (None, known / 1000):
                    wrong.append(known)
        return wrong

    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(work, range(4))) == [[]] * 4
    table.add(free_box(7), 0.5)
    assert len(table) == 6000
    assert table.find(free_box(6000)) is None
    assert all(table.find(free_box(number)) == number / 1000 for number in range(6000))
