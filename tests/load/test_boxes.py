"""A load: which boxes it accepts, and what it keeps of them."""

from contextlib import nullcontext
from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from tests.load.walls import KINDS, crossed_bars, of_corners, own_load
from unload import task
from unload.load.boxes import (
    ABOVE,
    BELOW,
    BESIDE,
    CONTACT_TOLERANCE,
    Load,
    _find_contacts,
    check_no_overhang,
    check_supported,
    slabs,
)
from unload.support.compiled import Compiled

FIELDS = ("positions", "sizes", "packages", "walls")


def one_box(**changes) -> Load:
    """A load of one valid box, with some fields replaced."""
    return Load(**{"positions": [[3.5, 1.25, 0.5]], "sizes": np.ones((1, 3))} | changes)


def test_a_load_cannot_be_changed(full_load):
    positions, stops = np.array([[3.5, 1.25, 0.5]]), np.array([3])
    load = one_box(positions=positions, extras={"stop": stops})
    positions[:], stops[:] = 0, 0
    assert load.positions.tolist() == [[3.5, 1.25, 0.5]] and load.extras["stop"].tolist() == [3]
    for name in FIELDS:
        with pytest.raises(ValueError, match="read-only"):
            getattr(full_load, name)[0] = 0
    for array in (*full_load.contacts, full_load.contacts.of(ABOVE, 0)):
        with pytest.raises(ValueError, match="read-only"):
            array[:] = 0
    with pytest.raises(FrozenInstanceError):
        full_load.sizes = full_load.positions


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"positions": np.zeros((0, 3))}, ValueError, "positions is empty"),
        ({"positions": [[3.5, 1.25, 0.4]]}, ValueError, r"box \[0\]: reaches from"),
        ({"sizes": np.ones((2, 3))}, ValueError, r"sizes has shape \(2, 3\); expected \(1, 3\)"),
        ({"sizes": [[0.0009, 1, 1]]}, ValueError, r"box \[0\]: edges of .* >= 0.002 m"),
        ({"packages": [0.0]}, TypeError, "packages has dtype float64; expected integers"),
        ({"walls": [-1]}, ValueError, "walls holds -1; expected numbers >= 0"),
        ({"walls": [[0]]}, ValueError, r"walls has shape \(1, 1\)"),
        ({"ids": ["a", "b"]}, ValueError, r"ids has shape \(2,\); expected \(1,\)"),
        ({"extras": {"stop": [3, 4]}}, ValueError, r"extras\['stop'\] has shape \(2,\)"),
        ({"container": (7.0, 2.5)}, ValueError, r"container has shape \(2,\)"),
    ],
)
def test_bad_loads_are_refused(changes, error, message):
    with pytest.raises(error, match=message):
        one_box(**changes)


@pytest.mark.parametrize("kind", [*KINDS, "crossed bars"])
def test_contacts_covered_and_behind_are_what_their_definitions_say(rng, kind):
    """Some boxes, one after the other, against all, in containers of which a half is left."""
    load = own_load(rng, kind) if kind in KINDS else crossed_bars(20)
    low, high = load.positions - load.sizes / 2, load.positions + load.sizes / 2
    present = rng.random(len(load)) < 0.5
    covered, behind = load.covered(present), load.behind(present)
    for box in rng.permutation(len(load))[:200]:
        shared = np.minimum(high[box], high) - np.maximum(low[box], low)
        x, y, z = (shared > CONTACT_TOLERANCE).T
        above = x & y & (abs(low[:, 2] - high[box, 2]) <= load.contact_tolerance)
        below = x & y & (abs(high[:, 2] - low[box, 2]) <= load.contact_tolerance)
        beside = x & z & (abs(shared[:, 1]) <= CONTACT_TOLERANCE)
        for contact, wanted in ((ABOVE, above), (BELOW, below), (BESIDE, beside)):
            assert sorted(load.contacts.of(contact, box)) == np.flatnonzero(wanted).tolist()
        front = (shared[:, 1:] > 1e-6).all(axis=1) & (low[:, 0] >= high[box, 0] - 1e-6)
        over = x & y & (low[:, 2] >= high[box, 2] - 1e-6)
        assert covered[box] == present[over].any() and behind[box] == present[front].any()


@pytest.mark.parametrize("reach", [2e-6, 0.01, 0.3])
@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("side", [-1, 1])
def test_a_box_that_reaches_into_another_is_refused(side, axis, reach):
    """However little, and from any side; or stands in the same place."""
    low = np.stack(np.meshgrid(*[[0.2, 1.0, 1.8]] * 3), axis=-1).reshape(27, 3)
    other = low[13].copy()
    other[axis] += side * (0.3 - reach)
    with pytest.raises(ValueError, match=r"boxes \[13, 27\]: overlap by .* m; expected none"):
        of_corners([*low, other], np.full((28, 3), 0.3))


@pytest.mark.parametrize("tolerance", [CONTACT_TOLERANCE, 0.003])
def test_boxes_above_one_another_touch_up_to_the_tolerance_of_their_load(tolerance):
    """Those side by side up to the usual one, whatever it is."""
    for share, touches in ((0.99, True), (1.01, False)):
        above, beside = 1 + share * tolerance, 1 + share * CONTACT_TOLERANCE
        corners = [(0, 0, 0), (0, 0, above), (0, beside, 0)]
        load = of_corners(corners, np.ones((3, 3)), contact_tolerance=tolerance)
        assert load.contacts.of(ABOVE, 0).tolist() == [1] * touches
        assert load.contacts.of(BESIDE, 0).tolist() == [2] * touches


def test_packages_and_walls_follow_from_the_boxes(full_load):
    load = Load(full_load.positions, full_load.sizes)
    assert (load.walls == full_load.walls).all()
    pairs = {*zip(load.packages.tolist(), full_load.packages.tolist())}
    assert len(pairs) == len({*load.packages.tolist()}) == len({*full_load.packages.tolist()})


def test_what_shares_less_than_the_tolerance_of_a_contact_hangs_over_nothing():
    """A box on another one, and next to it a lower one, into which it reaches by so much."""
    for share, refused in ((0.5, False), (2.0, True)):
        reach = share * CONTACT_TOLERANCE
        corners = [(0, 0, 0), (0, 0, 1), (0, 1, 0)]
        load = of_corners(corners, [(1, 1, 1), (1, 1 + reach, 0.5), (1, 0.5, 0.8)])
        with pytest.raises(ValueError, match="1 hangs over 2") if refused else nullcontext():
            check_no_overhang(load)


def test_what_a_box_rests_on_over_others_it_does_not_hang_over():
    """It reaches beyond the box between them."""
    corners = [(0, 0.1, 0), (0, 0.1, 1), (0, 0, 1.5)]
    check_no_overhang(of_corners(corners, [(1, 1, 1), (1, 1, 0.5), (1, 1.2, 0.5)]))


@pytest.mark.parametrize(("share", "floats"), [(0.5, False), (2.0, True)])
def test_a_box_stands_on_the_floor_within_the_tolerance_of_a_contact(share, floats):
    load = of_corners([(0, 0, share * CONTACT_TOLERANCE)], [(1, 1, 1)])
    with pytest.raises(ValueError, match="floats in load") if floats else nullcontext():
        check_supported(load)


def test_two_boxes_with_the_same_id_are_refused():
    with pytest.raises(ValueError, match=r"boxes \[0, 1\]: the same id"):
        of_corners([(0, 0, 0), (1, 0, 0)], np.ones((2, 3)), ids=["a", "a"])


def test_slabs_end_where_nothing_overlaps():
    assert slabs(np.array([1.0, 0.0, 1.5]), np.array([2.0, 1.0, 2.0])).tolist() == [1, 0, 1]


def test_the_container_is_the_papers_or_ones_own():
    assert (one_box().container == task.CONTAINER).all()
    deep = np.array([[11.5, 1.25, 0.5]])
    load = one_box(positions=deep, container=[12.0, 2.5, 1.0])
    assert load.container.tolist() == [12, 2.5, 1] and not load.container.flags.writeable
    for container in ((7.0, 2.5, 2.5), (12.0, 2.5, 0.9)):
        with pytest.raises(ValueError, match="reaches from"):
            one_box(positions=deep, container=container)


def test_contacts_that_are_not_compiled_are_the_same(full_load, monkeypatch):
    low, high = full_load.positions - full_load.sizes / 2, full_load.positions + full_load.sizes / 2
    found = []
    for compiled in (True, False):
        monkeypatch.setattr(Compiled, "any_compiled", compiled)
        found.append(_find_contacts(low, high, CONTACT_TOLERANCE))
    for one, other in zip(*found):
        assert np.array_equal(one, other) and one.dtype == other.dtype == np.int32
