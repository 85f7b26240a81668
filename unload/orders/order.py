"""An order of picks that can be carried out from the entrance, by the places of the boxes alone."""

from collections.abc import Callable, Sequence
from heapq import heapify, heappop, heappush

import numpy as np
import pandas as pd

from unload.load.boxes import OVERLAP, Load, check_supported
from unload.support import checks

Rule = Callable[[Load, np.ndarray], Sequence[np.ndarray]]


def reachable(load: Load, present: np.ndarray) -> tuple[np.ndarray, ...]:
    """The rule of an order that can be carried out from the entrance.

    First what no box lies on or hangs over, then what has none in front of it, then the foremost,
    then the highest. What is in front of a box stands nearer to the entrance and overlaps it in y
    and z.

    Args:
        load: its positions, sizes, contacts, ids and extras are what a rule may use.
        present: (n,) bool, the boxes that are left.

    Returns:
        Keys, (n,) each, the most important one first: the box with the largest ones is picked.
    """
    return ~load.covered(present), ~load.behind(present), *_front_and_top(load)


def _front_and_top(load: Load) -> np.ndarray:
    """The front and the top of each box, (2, n) float64."""
    # Rounded, so that equal places are equal, however they were computed.
    return np.rint((load.positions + load.sizes / 2)[:, [0, 2]].T / OVERLAP)


def picking_order(load: Load, by: str | None = None, rule: Rule | None = None) -> pd.DataFrame:
    """Order the boxes of a load so that each can be taken out when its turn comes.

    No lift is simulated. What a learned policy picks is an episode of ``ContainerEnv(stack=...)``.

    Args:
        load: see ``unload.read_load``. Its places are taken as they are: where they are measured,
            an overlap smaller than their error may be overlooked.
        by: a name in ``load.extras`` of numbers, such as ``"stop"``, in capitals or not: of the
            boxes that can be reached the lowest stop comes first, or with ``"-stop"`` the highest.
            Boxes of later stops come out early only if they stand in the way of an earlier one.
        rule: instead of ``reachable``, a function of the load and what is present that returns
            keys. What can be reached, the heaviest first::

                def heaviest(load, present):
                    uncovered, in_front, *others = reachable(load, present)
                    return uncovered, in_front, load.extras["weight"], *others

    Returns:
        A row for each pick: ``pick``, counted from 1; ``id`` of the box, the number of its item if
        the load has no ids; ``item``, its row in the load; ``covered`` and ``behind``, True if a
        box lay on it or hung over it, or stood in front of it, see ``Load``; with ``by``,
        ``early``, True if a box of an earlier stop was left; and the load's ``extras``.

    Raises:
        TypeError, ValueError: an argument is not as described, or ``rule`` returns other than
            keys.
    """
    check_supported(load)
    if by is not None and rule is not None:
        raise ValueError("by and rule are given; expected one of them")
    if rule is not None and not callable(rule):
        raise TypeError(f"rule is {rule!r}; expected a function of a load and what is present")
    stops = None if by is None else _stops(load, by)
    items = _reachable_first(load, stops) if rule is None else _by_rule(load, rule)

    names = items if load.ids is None else load.ids[items]
    columns = {"pick": 1 + np.arange(len(load)), "id": names, "item": items}
    turns = np.argsort(items)  # of each box
    for name, (boxes, others) in (("covered", load.covers), ("behind", load.fronts)):
        columns[name] = np.isin(items, boxes[turns[others] > turns[boxes]])
    if stops is not None:
        left = stops[items]
        columns["early"] = left > np.minimum.accumulate(left[::-1])[::-1]
    for name, values in load.extras.items():
        columns[f"{name} in the list" if name in columns else name] = values[items]
    return pd.DataFrame(columns)


def _by_rule(load: Load, rule: Rule) -> np.ndarray:
    """The items in the order of a rule, which is asked before each pick, (n,) int64."""
    present, order = np.ones(len(load), bool), []
    while present.any():
        returned = rule(load, present.copy())
        checks.instance("what rule returned", returned, Sequence, "arrays of numbers")
        keys = checks.finite_array("what rule returned", returned, (None, len(load)))
        # lexsort takes its last key first and the smallest first; equal boxes stay in the list's
        # order.
        items = np.flatnonzero(present)
        order.append(items[np.lexsort(-keys[::-1, items])[0]])
        present[order[-1]] = False
    return np.array(order)


def _reachable_first(load: Load, stops: np.ndarray | None) -> np.ndarray:
    """The items in the order of ``reachable``, (n,) int64, the lowest stops first if given.

    The same as by asking the rule before each pick. But what a rule prefers among the boxes that
    can be reached does not change, and a pick frees only those that waited for this very box.
    """
    keys = [*-_front_and_top(load)[::-1]]
    # The order in which they would come if all could be reached, and the turn of each box in it.
    preferred = np.lexsort(keys if stops is None else [*keys, _due(load, stops)])
    turns = np.argsort(preferred).tolist()

    # First of what lies above, then of what stands in front: for how many such boxes each one
    # waits, and which ones it frees, those below it and those behind it.
    waits_for, frees = [], []
    for boxes, others in (load.covers, load.fronts):
        waits_for.append(np.bincount(boxes, minlength=len(load)))
        ends = np.cumsum(np.bincount(others, minlength=len(load)))
        frees.append(np.split(boxes[np.argsort(others)], ends[:-1]))

    def key(box: int) -> tuple[bool, bool, int]:
        return bool(waits_for[0][box]), bool(waits_for[1][box]), turns[box]

    # Blocked boxes are in the heap, too, behind all free ones: where boxes wait for each other in a
    # circle none is free, and the rule picks a blocked one. A box that has become free is pushed
    # again, with a smaller key; by the time of its older entry it is gone.
    heap, present, order = [*map(key, range(len(load)))], np.ones(len(load), bool), []
    heapify(heap)
    while heap:
        item = preferred[heappop(heap)[-1]]
        if present[item]:
            present[item] = False
            order.append(item)
            for counts, lists in zip(waits_for, frees):
                freed = lists[item]
                counts[freed] -= 1
                for box in freed[counts[freed] == 0]:
                    heappush(heap, key(box))
    return np.array(order)


def _due(load: Load, stops: np.ndarray) -> np.ndarray:
    """When each box is due, (n,) float64: at the earliest stop that waits for it.

    This is the lowest of its own and of those of all boxes that cannot come out before it; so a
    box leaves before its own stop only to free an earlier one.
    """
    due, before = stops.copy(), None
    blocked, blocking = np.hstack([load.fronts, load.covers])
    while before is None or (due < before).any():
        before = due.copy()
        np.minimum.at(due, blocking, due[blocked])
    return due


def _stops(load: Load, by: str) -> np.ndarray:
    """The stop of each box, (n,) float64, so that the lowest is the first; see ``by``."""
    checks.instance("by", by, str, "the name of a column")
    falling = by.startswith("-") and by not in load.extras
    named = {name.lower(): name for name in load.extras} | {name: name for name in load.extras}
    asked = by[1:] if falling else by
    if (name := named.get(asked, named.get(asked.lower()))) is None:
        known = ", ".join(load.extras) or "it has none"
        raise ValueError(f"by is {by!r}; expected one of the list's other columns: {known:.1000}")
    cells = pd.Series(load.extras[name])
    # A date is a number, too, and so is a missing one.
    stops = pd.to_numeric(cells, errors="coerce").where(cells.notna()).to_numpy(float)
    wrong = np.flatnonzero(~np.isfinite(stops))
    if wrong.size:
        first = wrong[0] if load.ids is None else load.ids[wrong[0]]
        raise ValueError(
            f"{len(wrong)} boxes have no number in {name!r}, the first {first}; "
            "expected the number of its stop for each"
        )
    return -stops if falling else stops
