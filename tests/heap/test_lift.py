import pytest

from unload.heap.episodes import play
from unload.heap.lift import LiftEnv, Lifter
from unload.heap.rules import RULES


@pytest.fixture
def lifter():
    made = Lifter("coarse")
    yield made
    made.close()


def test_a_free_box_comes_and_a_covered_one_does_not(lifter, cubes):
    tower = cubes((5, 1, 0), (5, 1, 1), (6, 2, 0))
    top = lifter.pick(tower, 1)
    assert top.came and 0.4 < top.moved < 0.5
    assert top.unloaded.tolist() == [False, True, False] and top.left.tolist() == [0, 2]
    assert not top.fallen.any() and len(top.heap) == 2
    bottom = lifter.pick(tower, 0)
    assert not bottom.came and bottom.moved < 0.1 and not bottom.unloaded.any()
    assert bottom.heap is tower, "a failed lift changes nothing"


def test_what_drops_meanwhile_has_fallen(lifter, cubes):
    """A cube begins in the air, 0.8 m above the floor."""
    outcome = lifter.pick(cubes((5, 1, 0), (6, 2, 2)), 0)
    assert outcome.came and outcome.fallen.tolist() == [False, True]
    assert outcome.heap.positions[0, 2] == pytest.approx(0.2, abs=0.01)
    failed = lifter.pick(cubes((5, 1, 0), (5, 1, 1), (6, 2, 2)), 0)
    assert not failed.came and not failed.fallen.any()


def test_a_lift_depends_on_nothing_but_the_heap(lifter, pile):
    first = lifter.pick(pile, 7)
    lifter.pick(pile, 1)
    again = lifter.pick(pile, 7)
    assert again.moved == first.moved
    assert again.heap.positions.tobytes() == first.heap.positions.tobytes()


def test_the_environment_lifts_with_its_own_settings(pile):
    env = LiftEnv(heaps=[pile], physics="coarse", max_picks=3)
    episode = play(env, RULES["highest"], pile, 0)
    assert episode.unloaded.tolist() == [1, 1, 1]
    env.close()
    heavy = LiftEnv(heaps=[pile], physics="coarse", max_picks=2, mass=3.0)
    assert play(heavy, RULES["highest"], pile, 0).unloaded.tolist() == [0, 0], "20 N lift 2 kg"
    heavy.close()


def test_bad_input_is_refused(lifter, pile):
    with pytest.raises(TypeError, match="heap is 3; expected a Heap"):
        lifter.pick(3, 0)
    with pytest.raises(ValueError, match="box is 9"):
        lifter.pick(pile, 9)
