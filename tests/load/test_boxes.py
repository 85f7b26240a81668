"""A load: which boxes it accepts, and what it keeps of them."""

import sys
from dataclasses import FrozenInstanceError, replace
from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.load.walls import corners
from unload import task
from unload.load.boxes import (
    _SMALLEST_EDGE,
    ABOVE,
    BELOW,
    BESIDE,
    CONTACT_TOLERANCE,
    Load,
    _find_contacts,
)

FIELDS = ("positions", "sizes", "packages", "walls")


def one_box(**changes) -> Load:
    """A load of one valid box, with some fields replaced."""
    return Load(**{"positions": [[3.5, 1.25, 0.5]], "sizes": np.ones((1, 3))} | changes)


def test_a_load_cannot_be_changed(full_load):
    positions = np.array([[3.5, 1.25, 0.5]])
    load = one_box(positions=positions)
    positions[:] = 0
    assert load.positions.tolist() == [[3.5, 1.25, 0.5]]
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
        # Two others stick out by less than is tolerated.
        (
            {
                "positions": [[0.5 - 5e-7, 0.5, 0.5], [6.5 + 5e-7, 0.5, 0.5], [3.5, 1.25, 0.4]],
                "sizes": np.ones((3, 3)),
            },
            ValueError,
            r"box \[2\]: reaches from",
        ),
        ({"sizes": np.ones((2, 3))}, ValueError, r"sizes has shape \(2, 3\); expected \(1, 3\)"),
        ({"sizes": [[0.0009, 1, 1]]}, ValueError, r"box \[0\]: edges of .* >= 0.002 m"),
        ({"packages": [0.0]}, TypeError, "packages has dtype float64; expected integers"),
        ({"walls": [[0]]}, ValueError, r"walls has shape \(1, 1\)"),
        ({"masses": [0.0]}, ValueError, r"box \[0\]: a mass of 0.0 kg; expected >= 0.001 kg"),
        ({"ids": ["a", "b"]}, ValueError, r"ids has shape \(2,\); expected \(1,\)"),
        ({"extras": {"stop": [3, 4]}}, ValueError, r"extras\['stop'\] has shape \(2,\)"),
        ({"container": (7.0, 2.5)}, ValueError, r"container has shape \(2,\)"),
        ({"ceiling": np.ones(2)}, TypeError, "ceiling is array.*; expected a number"),
    ],
)
def test_bad_loads_are_refused(changes, error, message):
    with pytest.raises(error, match=message):
        one_box(**changes)


@settings(max_examples=60)
@given(corners())
def test_disjoint_boxes_are_accepted_and_those_that_touch_are_known(boxes):
    low, high = boxes
    load = Load.from_corners(low, high - low)
    assert len(load) == len(low)
    for one in range(len(low)):
        for other in range(len(low)):
            shared = np.minimum(high[one], high[other]) - np.maximum(low[one], low[other])
            over = abs(low[other, 2] - high[one, 2]) <= CONTACT_TOLERANCE
            stands = one != other and over and (shared[:2] > CONTACT_TOLERANCE).all()
            assert (other in load.contacts.of(ABOVE, one)) == stands
            assert (one in load.contacts.of(BELOW, other)) == stands
            near = abs(shared[1]) <= CONTACT_TOLERANCE
            beside = one != other and near and (shared[[0, 2]] > CONTACT_TOLERANCE).all()
            assert (other in load.contacts.of(BESIDE, one)) == beside


@settings(max_examples=60)
@given(corners(), st.data())
def test_a_box_that_reaches_into_another_is_refused(boxes, data):
    low, high = boxes
    first = data.draw(st.integers(0, len(low) - 1))
    # A further box that reaches into this one from any side, however little.
    reach = data.draw(st.sampled_from([2e-6, 1e-4, 0.01]))
    axis, upwards = data.draw(st.integers(0, 2)), data.draw(st.booleans())
    other_low, other_high = low[first].copy(), high[first].copy()
    if upwards:
        other_low[axis] = high[first, axis] - reach
        other_high[axis] = min(other_low[axis] + 0.3, task.CONTAINER[axis])
    else:
        other_high[axis] = low[first, axis] + reach
        other_low[axis] = max(other_high[axis] - 0.3, 0)
    if other_high[axis] - other_low[axis] < _SMALLEST_EDGE:
        other_low, other_high = low[first], high[first]  # no room beside it: the same place
    low, high = np.vstack([low, other_low]), np.vstack([high, other_high])
    with pytest.raises(ValueError, match=r"boxes .*: overlap by .* m; expected none"):
        Load.from_corners(low, high - low)


@pytest.mark.parametrize("tolerance", [CONTACT_TOLERANCE, 0.003])
def test_boxes_above_one_another_touch_up_to_the_tolerance_of_their_load(tolerance):
    """Those side by side up to the usual one, whatever it is."""
    for share, touches in ((0.99, True), (1.01, False)):
        above, beside = 1 + share * tolerance, 1 + share * CONTACT_TOLERANCE
        corners = [(0, 0, 0), (0, 0, above), (0, beside, 0)]
        load = Load.from_corners(corners, np.ones((3, 3)), contact_tolerance=tolerance)
        assert load.contacts.of(ABOVE, 0).tolist() == [1] * touches
        assert load.contacts.of(BESIDE, 0).tolist() == [2] * touches


def test_packages_and_walls_follow_from_the_boxes(full_load):
    load = Load(full_load.positions, full_load.sizes)
    assert (load.walls == full_load.walls).all()
    pairs = {*zip(load.packages.tolist(), full_load.packages.tolist())}
    assert len(pairs) == len({*load.packages.tolist()}) == len({*full_load.packages.tolist()})


def test_the_container_is_the_papers_or_ones_own():
    assert (one_box().container == task.CONTAINER).all()
    deep = np.array([[11.5, 1.25, 0.5]])
    load = one_box(positions=deep, container=[12.0, 2.5, 1.0])
    assert load.container.tolist() == [12, 2.5, 1] and not load.container.flags.writeable
    for container in ((7.0, 2.5, 2.5), (12.0, 2.5, 0.9)):
        with pytest.raises(ValueError, match="reaches from"):
            one_box(positions=deep, container=container)


def test_what_a_packer_returns_becomes_a_load_in_one_call():
    """Corners, and numbers that are decimals, as those of ``py3dbp`` are."""
    low = [[Decimal(0)] * 3, [Decimal(0), Decimal(0), Decimal("0.3")]]
    sizes = [[Decimal("0.5"), Decimal("0.4"), Decimal("0.3")], [Decimal(1)] * 3]
    load = Load.from_corners(low, sizes, ids=["a", "b"], extras={"stop": [2, 1]})
    assert load.positions.tolist() == [[0.25, 0.2, 0.15], [0.5, 0.5, 0.8]]
    assert load.ids.tolist() == ["a", "b"] and load.extras["stop"].tolist() == [2, 1]


@settings(max_examples=60)
@given(corners(), st.data())
def test_behind_and_covered_are_what_their_definitions_say(boxes, data):
    low, high = boxes
    load = Load.from_corners(low, high - low)
    present = np.array(data.draw(st.lists(st.booleans(), min_size=len(low), max_size=len(low))))
    for box in range(len(low)):
        shared = np.minimum(high[box], high) - np.maximum(low[box], low)
        front = (shared[:, 1:] > 1e-6).all(axis=1) & (low[:, 0] >= high[box, 0] - 1e-6)
        assert load.behind(present)[box] == front[present].any()
        above = load.contacts.of(ABOVE, box)
        assert load.covered(present)[box] == present[above].any()


def test_contacts_without_numba_are_the_same(full_load, monkeypatch):
    low, high = full_load.positions - full_load.sizes / 2, full_load.positions + full_load.sizes / 2
    monkeypatch.delitem(sys.modules, "numba", raising=False)
    for one, other in zip(full_load.contacts, _find_contacts(low, high)):
        assert np.array_equal(one, other) and one.dtype == other.dtype == np.int32


def test_masses_are_those_of_the_task_unless_given_and_headroom_ends_at_the_ceiling():
    assert one_box().masses.tolist() == [1.0] and one_box(masses=[3]).masses.tolist() == [3.0]
    assert one_box().headroom.tolist() == replace(one_box()).headroom.tolist() == [np.inf]
    assert one_box(ceiling=1.1).headroom == pytest.approx([0.1])
