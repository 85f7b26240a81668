import numpy as np

from studies.seamless.jams import Case, cases, load_of, place, visible_free
from unload.load.boxes import ABOVE


def test_the_foremost_walls_are_moved_to_the_rear(full_load):
    load = load_of(Case(load=0))
    front = full_load.walls >= 9
    assert (load.sizes == full_load.sizes[front]).all() and load.positions[:, 0].min() < 0.6
    assert np.ptp(full_load.positions[front] - load.positions, axis=0).max() < 1e-12


def test_what_is_lifted_is_seen_and_has_nothing_on_top(full_load):
    present = np.ones(len(full_load), bool)
    free = visible_free(full_load, present)
    assert 0 < len(free) < 128 and (np.diff(free) > 0).all()
    assert not [box for box in free if len(full_load.contacts.of(ABOVE, box))]


def test_a_place_says_what_touches_a_box(boxes):
    load = boxes((0.2, 0.2), (0.6, 0.2), (1.5, 0.2))  # two side by side at the wall, one alone
    present = np.ones(3, bool)
    places = [place(load, present, box) for box in range(3)]
    assert [each["beside"] for each in places] == [1, 1, 0]
    assert [each["edge"] for each in places] == [True, False, False]
    assert not any(each["covered"] or each["wall"] for each in places)
    present[1] = False
    assert place(load, present, 0)["beside"] == 0


def test_no_case_is_computed_twice():
    listed = list(cases())
    assert len(set(listed)) == len(listed)
