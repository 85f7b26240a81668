"""The order of picks of one load."""

import inspect
import textwrap

import numpy as np
import pandas as pd
import pytest

from tests.load.walls import KINDS, of_corners, own_load
from unload import Load, picking_order, read_load, stack_load
from unload.load.boxes import OVERLAP
from unload.orders.order import _by_rule, _reachable_first, reachable

# A high box behind a tall one lies on a plank, which lies on what stands before the tall.
CIRCLE = (
    [(2, 0, 0), (3, 0, 0), (1, 1, 0.5), (1, 0.5, 0.8), (1, 1, 0)],
    [(1, 1, 1.5), (1, 2, 0.5), (2.5, 1, 0.3), (1, 1.1, 0.5), (0.5, 1, 0.5)],
)


def test_an_order_has_a_row_for_each_pick_and_can_be_carried_out(small_load):
    order = picking_order(small_load)
    assert order.columns.tolist() == ["pick", "id", "item", "covered", "behind"]
    assert order["pick"].tolist() == list(range(1, len(small_load) + 1))
    assert order["item"].tolist() == by_definition(small_load, None)
    assert order["id"].tolist() == order["item"].tolist()  # these loads have no ids
    assert not order[["covered", "behind"]].any(axis=None)


def by_definition(load: Load, stops: np.ndarray | None) -> list[int]:
    """The items as the docstrings describe the order, pick by pick, from all pairs of boxes."""
    low, high = load.positions - load.sizes / 2, load.positions + load.sizes / 2
    overlap = np.minimum(high[:, None], high) - np.maximum(low[:, None], low) > OVERLAP
    over = overlap[..., 0] & overlap[..., 1] & (load.positions[:, None, 2] < load.positions[:, 2])
    front = overlap[..., 1] & overlap[..., 2] & (low[:, None, 0] < low[:, 0])
    due, before = np.zeros(len(load)) if stops is None else stops.astype(float), None
    while before is None or (due != before).any():  # at the earliest stop that waits for a box
        due, before = np.minimum(due, np.where(over | front, due[:, None], np.inf).min(axis=0)), due
    near, top = np.rint(high[:, [0, 2]].T / OVERLAP)
    left, items = np.arange(len(load)), []
    while len(left):
        on, behind = (pairs[np.ix_(left, left)].any(axis=1) for pairs in (over, front))
        first = np.lexsort((left, -top[left], -near[left], due[left], behind, on))[0]
        items.append(left[first])
        left = np.delete(left, first)
    return items


@pytest.mark.parametrize("kind", [*KINDS, "the paper's", "strewn", "a circle"])
def test_orders_are_those_of_their_definition(kind):
    """Of a few boxes and of many, in any order of the list, with stops and without.

    Strewn boxes float and form chains; equal ones are ties.
    """
    for seed in range(4):
        rng = np.random.default_rng(seed)
        if kind == "the paper's":
            load = stack_load(rng, walls=1 + seed % 3)
        elif kind == "a circle":
            load = of_corners(*CIRCLE)
        elif kind == "strewn":
            places = np.argwhere(rng.random((7, 5, 5)) < 0.2 + 0.2 * seed)
            load = of_corners(places * [1, 0.5, 0.5], rng.choice([0.3, 0.5], (len(places), 3)))
        else:
            load = own_load(rng, kind)
        few = rng.permutation(len(load))[: (300, 60, 8, 1)[seed]]
        load = Load(load.positions[few], load.sizes[few])
        for stops in (None, rng.integers(1 + seed, size=len(load)), rng.normal(size=len(load))):
            expected = by_definition(load, stops)
            assert _reachable_first(load, stops).tolist() == expected
            if stops is None:
                assert _by_rule(load, reachable).tolist() == expected


def test_a_rule_knows_the_load_and_what_is_present(boxes):
    load, seen = boxes((0.3, 0.2), (0.8, 0.2), (1.3, 0.2), (1.8, 0.2)), []
    extras = {"stop": [2, 1, 2, 1], "item": list("wxyz")}
    load = Load(load.positions, load.sizes, ids=list("abcd"), extras=extras)

    def by_stop(load, present):
        seen.append(present.sum())
        present[:] = False  # a copy
        return -load.extras["stop"], load.ids == "c"

    order = picking_order(load, rule=by_stop)
    assert order["id"].tolist() == ["b", "d", "c", "a"], "equal ones in the order of the list"
    assert order["stop"].tolist() == [1, 1, 2, 2] and order["item"].tolist() == [1, 3, 2, 0]
    assert order["item in the list"].tolist() == ["x", "z", "y", "w"]
    assert seen == [4, 3, 2, 1]


def test_an_order_says_what_lay_on_a_box_or_stood_in_front_of_it():
    """Of a rule that prefers the lowest boxes: a stack of two, and one before it."""
    load = of_corners([(0, 0, 0), (0, 0, 0.4), (1, 0, 0)], np.full((3, 3), 0.4))
    order = picking_order(load, rule=lambda load, present: [-load.positions[:, 2]])
    assert order["item"].tolist() == [0, 2, 1]
    assert order["covered"].tolist() == [True, False, False]
    assert order["behind"].tolist() == [True, False, False]


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ({"rule": reachable, "by": "stop"}, ValueError, "by and rule are given; expected one"),
        ({"by": ["stop"]}, TypeError, r"by is \['stop'\]; expected the name of a column"),
        ({"rule": 3}, TypeError, "rule is 3; expected a function"),
        ({"by": "stp"}, ValueError, "by is 'stp'; .* one of the list's other columns: it has none"),
        ({"rule": lambda load, _: [np.full(len(load), np.nan)]}, ValueError, "holds nan"),
        ({"rule": lambda load, _: [np.ones(3)]}, ValueError, "rule returned has shape"),
        ({"rule": lambda load, _: 3}, TypeError, "what rule returned is 3; expected arrays"),
        ({"load": Load([[3.5, 1, 0.9]], [[0.4, 0.4, 0.4]])}, ValueError, "floats in load"),
    ],
)
def test_what_is_no_order_is_refused(given, error, message):
    with pytest.raises(error, match=message):
        picking_order(**{"load": read_load()} | given)


@pytest.mark.parametrize(("by", "sign"), [("stop", 1), ("-stop", -1)])
def test_an_order_by_stops_can_be_carried_out_and_says_what_comes_out_early(rng, by, sign):
    load = stack_load(rng, walls=3)
    stops = rng.integers(3, size=len(load)) + 9
    load = Load(load.positions, load.sizes, extras={"stop": stops.astype(str)})
    order = picking_order(load, by=by)
    assert order["item"].tolist() == by_definition(load, sign * stops)
    assert not order[["covered", "behind"]].any(axis=None)
    turns = sign * stops[order["item"]]
    early = [(turns[pick:] < turn).any() for pick, turn in enumerate(turns)]
    assert order["early"].tolist() == early and sum(early) > 20


def test_a_column_of_stops_is_found_in_capitals_or_not_and_the_exact_name_comes_first(boxes):
    load = boxes((0.3, 0.2), (0.8, 0.2), (1.3, 0.2))
    for names, by, items in (
        (["Stop"], "stop", [1, 2, 0]),
        (["Stop"], "-STOP", [0, 2, 1]),
        (["stop", "Stop"], "stop", [0, 2, 1]),
        (["-stop"], "-stop", [1, 2, 0]),
    ):
        extras = dict(zip(reversed(names), ([3, 1, 2], [1, 3, 2])))
        load = Load(load.positions, load.sizes, extras=extras)
        order = picking_order(load, by=by)
        assert order["item"].tolist() == items and not order["early"].any()


def test_the_rule_in_the_docstring_works(small_load):
    text = inspect.cleandoc(picking_order.__doc__)
    _, _, example = text.partition("the heaviest first::\n\n")
    code = textwrap.dedent(example.partition("\n\n")[0])
    exec(code, space := {"reachable": reachable})
    masses = 1 + np.arange(len(small_load)) % 7
    load = Load(small_load.positions, small_load.sizes, extras={"weight": masses})
    order = picking_order(load, rule=space["heaviest"])
    present = np.ones(len(load), bool)
    for item in order["item"]:
        free = present & ~load.covered(present) & ~load.behind(present)
        assert masses[item] == masses[free].max()
        present[item] = False


DATES = [pd.Timestamp(2026, 1, 2), pd.NaT, pd.NaT]


@pytest.mark.parametrize("stops", [["1", "", "B"], [1, None, np.inf], DATES])
def test_boxes_without_the_number_of_a_stop_are_counted_and_the_first_is_named(boxes, stops):
    load = boxes((0.3, 0.2), (0.8, 0.2), (1.3, 0.2))
    load = Load(load.positions, load.sizes, ids=list("abc"), extras={"stop": stops})
    message = "2 boxes have no number in 'stop', the first b; expected the number of its stop"
    with pytest.raises(ValueError, match=message):
        picking_order(load, by="-stop")
