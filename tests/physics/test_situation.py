import numpy as np
import pytest

from tests.load.walls import KINDS, own_load
from unload import stack_load
from unload.load.boxes import Load
from unload.physics.situation import Surroundings
from unload.plain import on_top, situation


def surroundings(load: Load) -> Surroundings:
    return Surroundings(load, np.ones(len(load), dtype=bool))


def test_equal_situations_have_equal_keys_and_whatever_may_matter_is_in_them(boxes):
    around = surroundings(boxes((0.8, 0.2), (1.0, 0.6), (1.6, 0.2), (1.8, 0.6)))
    first, second = around.situation(0), around.situation(2)
    assert first.key == second.key and first != second  # no comparison of arrays
    around.present[3] = False
    assert around.situation(2).key != first.key
    # A side wall 0.2 m to the left of a box, and a floor 0.2 m below another.
    wall, floor = surroundings(boxes((0.2, 0.6), (1.0, 0.2))).situation, (1.0, 0.2)
    assert wall(0).key != wall(1).key == surroundings(boxes(floor)).situation(0).key


@pytest.mark.parametrize("share", [1.0, 0.7, 0.3])
@pytest.mark.parametrize("kind", ["the paper's", *KINDS])
def test_situations_in_full_containers_are_those_of_the_plain_search(rng, kind, share):
    """With gaps to the side walls that are a little smaller and larger than the tolerance, too."""
    load = stack_load(rng, walls=2) if kind == "the paper's" else own_load(rng, kind)
    present = rng.random(len(load)) < share
    around = Surroundings(load, present)
    for item in np.flatnonzero(present).tolist():
        found, plain = around.situation(item), situation(load, present, item)
        assert around.on_top(item) == on_top(load, present, item)
        assert (found.floor, found.sides) == (plain.floor, plain.sides)
        assert found.key == plain.key and found.boxes.tobytes() == plain.boxes.tobytes()
