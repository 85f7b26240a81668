import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.env.plain import on_top, situation
from tests.load.walls import loads
from unload import stack_load, task
from unload.load.boxes import CONTACT_TOLERANCE, Load
from unload.physics.situation import Surroundings


def surroundings(load: Load) -> Surroundings:
    return Surroundings(load, np.ones(len(load), dtype=bool))


def test_a_box_that_bridges_two_rests_on_both(boxes):
    bridge = surroundings(boxes((1.0, 0.2), (1.4, 0.2), (1.2, 0.6)))
    assert bridge.on_top(0) == bridge.on_top(1) == [2]
    situation = bridge.situation(0)
    assert (situation.dynamic, situation.on_top) == (2, 1)
    # The chosen box, the bridge on top of it, and the bridge's other support, in micrometres.
    assert situation.boxes[:, 1:3].tolist() == [[0, 0], [200_000, 400_000], [400_000, 0]]
    assert (situation.boxes[:, 3:] == 400_000).all() and situation.boxes.dtype == np.int32


def test_floor_and_side_walls(boxes):
    load = boxes((0.2, 0.2), (0.2, 0.6), (1.25, 0.2), (2.3, 0.2))
    around = surroundings(load)
    assert around.situation(0).floor == -200_000 and around.situation(0).sides == (-200_000,)
    assert around.situation(1).floor is None and around.situation(1).sides == (-200_000,)
    assert around.situation(2).sides == ()
    assert around.situation(3).sides == (200_000,)
    narrow = Load(load.positions[:1] + (0, 1.8, 0), load.sizes[:1], container=(7.0, 2.2, 2.5))
    assert surroundings(narrow).situation(0).sides == (200_000,)
    y = task.CONTAINER[1] - CONTACT_TOLERANCE - 0.25  # exact in bits, and so is y + 0.25
    at_the_tolerance = surroundings(Load([[3.5, y, 0.25]], np.full((1, 3), 0.5)))
    assert at_the_tolerance.situation(0).sides == (250_100,)


@pytest.mark.parametrize("share", [0.9, 1.1])
def test_floor_and_side_walls_are_touched_within_the_tolerance(boxes, share):
    step = share * CONTACT_TOLERANCE
    around = surroundings(boxes((0.2 + step, 0.2 + step), (2.3 - step, 0.2)))
    first, second = around.situation(0), around.situation(1)
    micrometres = round(step * 1e6)
    near = share < 1
    assert first.floor == (-200_000 - micrometres if near else None) and second.floor == -200_000
    assert first.sides == ((-200_000 - micrometres,) if near else ())
    assert second.sides == ((200_000 + micrometres,) if near else ())


def test_equal_situations_have_equal_keys_and_whatever_may_matter_is_in_them(boxes):
    around = surroundings(boxes((0.8, 0.2), (1.0, 0.6), (1.6, 0.2), (1.8, 0.6)))
    first, second = around.situation(0), around.situation(2)
    assert first.key == second.key and first != second  # no comparison of arrays
    around.present[3] = False
    assert around.situation(2).key != first.key
    alone = surroundings(boxes((1.0, 0.2))).situation(0)
    beside, at_the_wall = boxes((1.0, 0.2), (1.4, 0.2)), boxes((0.2, 0.2))
    above_the_floor, covered = boxes((1.0, 0.6), (2.0, 0.2)), boxes((1.0, 0.2), (1.0, 0.6))
    for load in (beside, at_the_wall, above_the_floor, covered):
        assert surroundings(load).situation(0).key != alone.key


@settings(max_examples=80)
@given(load=loads(), data=st.data())
def test_situations_in_random_loads_are_those_of_the_plain_search(load, data):
    some = data.draw(st.lists(st.booleans(), min_size=len(load), max_size=len(load)))
    assert_searched_alike(load, np.array(some))


def assert_searched_alike(load: Load, present: np.ndarray) -> None:
    around = Surroundings(load, present)
    for item in np.flatnonzero(present).tolist():
        found, plain = around.situation(item), situation(load, present, item)
        assert around.on_top(item) == on_top(load, present, item)
        assert (found.floor, found.sides) == (plain.floor, plain.sides)
        assert found.key == plain.key and found.boxes.tobytes() == plain.boxes.tobytes()


@pytest.mark.parametrize("share", [1.0, 0.7, 0.3])
def test_so_are_those_in_loads_of_the_paper(rng, share):
    load = stack_load(rng, walls=2)
    assert_searched_alike(load, rng.random(len(load)) < share)
