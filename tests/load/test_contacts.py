"""Which boxes overlap, and which touch."""

import numpy as np
import pytest

from unload.load.contacts import ABOVE, BELOW, BESIDE, CONTACT_TOLERANCE, contacts, slabs


def corners(load):
    return load.positions - load.sizes / 2, load.positions + load.sizes / 2


def test_slabs_are_the_walls(full_load):
    low, high = corners(full_load)
    assert (slabs(low[:, 0] + 1e-6, high[:, 0]) == full_load.walls).all()


def test_slabs_join_what_overlaps_in_a_chain():
    groups = slabs(np.array([0.0, 5.0, 0.5, 1.5]), np.array([1.0, 6.0, 2.0, 3.0]))
    assert groups.tolist() == [0, 1, 0, 0]


def test_contacts_are_those_found_pair_by_pair(full_load):
    low, high = corners(full_load)
    shared = np.minimum(high[:, None], high) - np.maximum(low[:, None], low) > CONTACT_TOLERANCE
    # [i, j]: j begins where i ends.
    ends_where_begins = np.abs(high[:, None] - low) <= CONTACT_TOLERANCE
    in_line = shared[..., 0]
    above = in_line & shared[..., 1] & ends_where_begins[..., 2]
    beside = in_line & shared[..., 2] & (ends_where_begins[..., 1] | ends_where_begins[..., 1].T)
    found = contacts(low, high)
    for box in range(len(full_load)):
        for kind, wanted in ((ABOVE, above[box]), (BELOW, above[:, box]), (BESIDE, beside[box])):
            assert sorted(found.of(kind, box)) == np.flatnonzero(wanted).tolist()
    assert len(found.boxes) == 2 * above.sum() + beside.sum()


@pytest.mark.parametrize("walls", [1, 2])
def test_boxes_at_random_places(rng, walls):
    """Boxes that hardly touch, in one slab and in several."""
    places = rng.permutation(400)[:60]
    low = np.column_stack([places % walls, places // walls % 20, places // walls // 20]) * 0.5
    found = contacts(low, low + 0.5)
    for box in range(len(low)):
        for kind, step in ((ABOVE, (0, 0, 0.5)), (BELOW, (0, 0, -0.5))):
            wanted = np.flatnonzero((low == low[box] + step).all(axis=1))
            assert found.of(kind, box).tolist() == wanted.tolist()
        sideways = (np.abs(low - low[box]) == (0, 0.5, 0)).all(axis=1)
        assert sorted(found.of(BESIDE, box)) == np.flatnonzero(sideways).tolist()


@pytest.mark.parametrize(
    ("gap", "touches"), [(0.99e-4, True), (CONTACT_TOLERANCE, True), (1.01e-4, False)]
)
def test_boxes_touch_up_to_the_tolerance(gap, touches):
    low = np.array([[0, 0, 0], [0, 1 + gap, 0]])
    found = contacts(low, low + 1)
    assert found.of(BESIDE, 0).tolist() == ([1] if touches else [])


def test_a_box_alone_touches_nothing():
    found = contacts(np.zeros((1, 3)), np.ones((1, 3)))
    assert len(found.boxes) == 0 and found.of(ABOVE, 0).tolist() == []


def test_crossed_boxes_have_more_contacts_than_expected():
    """20 bars side by side, and 20 across them, each on all of the first."""
    count = 20
    places = np.arange(count) / count
    zeros = np.zeros(count)
    low = np.vstack(
        [np.column_stack([zeros, places, zeros]), np.column_stack([places, zeros, zeros + 1])]
    )
    sizes = np.repeat([[1, 1 / count, 1], [1 / count, 1, 1]], count, axis=0)
    found = contacts(low, low + sizes)
    assert len(found.boxes) == 2 * (count**2 + count - 1) > 2 * 8 * len(low)
    for bar in range(count):
        assert sorted(found.of(ABOVE, bar)) == list(range(count, 2 * count))
        assert sorted(found.of(BELOW, count + bar)) == list(range(count))


def test_overlaps_are_refused():
    low = np.array([[0.0, 1.0, 0.0], [0.0, -0.5, 0.0], [0.0, 0.9, 0.5]])
    with pytest.raises(ValueError, match="boxes 0 and 2 overlap"):
        contacts(low, low + 1)
