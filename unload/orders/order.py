"""An order of picks that can be carried out from the entrance, by the places of the boxes alone."""

from collections.abc import Callable, Sequence

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
    front, top = (load.positions + load.sizes / 2)[:, [0, 2]].T
    # Rounded, so that equal places are equal, however they were computed.
    foremost, highest = np.rint(front / OVERLAP), np.rint(top / OVERLAP)
    return ~load.covered(present), ~load.behind(present), foremost, highest


def picking_order(load: Load, by: str | None = None, rule: Rule | None = None) -> pd.DataFrame:
    """Order the boxes of a load so that each can be taken out when its turn comes.

    No lift is simulated. What a learned policy picks is an episode of ``ContainerEnv(stack=...)``.

    Args:
        load: see ``unload.read_load``.
        by: a name in ``load.extras`` of numbers, such as ``"stop"``: of the boxes that can be
            reached the lowest stop comes first, or with ``"-stop"`` the highest. Boxes of later
            stops come out early only if they stand in the way of an earlier one.
        rule: instead of ``reachable``, a function of the load and what is present that returns
            keys. What can be reached, the heaviest first::

                def heaviest(load, present):
                    uncovered, in_front, *others = reachable(load, present)
                    return uncovered, in_front, load.extras["weight"], *others

    Returns:
        A row for each pick: ``pick``, counted from 1; ``id`` of the box, the number of its item if
        the load has no ids; ``item``, its row in the load; ``covered`` and ``behind``, True if a
        box lay on it or hung over it, or stood in front of it, see ``Load``; and the load's
        ``extras``.

    Raises:
        TypeError, ValueError: an argument is not as described, or ``rule`` returns other than
            keys.
    """
    check_supported(load)
    if rule is None:
        rule = reachable if by is None else _by_stop(load, by)
    elif by is not None:
        raise ValueError("by and rule are given; expected one of them")
    elif not callable(rule):
        raise TypeError(f"rule is {rule!r}; expected a function of a load and what is present")
    present, rows = np.ones(len(load), bool), []
    for pick in range(1, len(load) + 1):
        returned = rule(load, present.copy())
        checks.instance("what rule returned", returned, Sequence, "arrays of numbers")
        keys = checks.finite_array("what rule returned", returned, (None, len(load)))
        # lexsort takes its last key first and the smallest first; equal boxes stay in the list's
        # order.
        items = np.flatnonzero(present)
        item = items[np.lexsort(-keys[::-1, items])[0]]
        name = item if load.ids is None else load.ids[item]
        rows.append((pick, name, item, load.covered(present)[item], load.behind(present)[item]))
        present[item] = False
    table = pd.DataFrame(rows, columns=["pick", "id", "item", "covered", "behind"])
    for name, values in load.extras.items():
        table[f"{name} in the list" if name in table else name] = values[table["item"]]
    return table


def _by_stop(load: Load, by: str) -> Rule:
    """The rule of an order by stops that can be carried out.

    A box is due at the earliest stop among itself and all boxes that cannot come out before it; so
    a box leaves before its own stop only to free an earlier one.
    """
    due = _stops(load, by)
    blocked, blocking = np.hstack([load.fronts, load.covers])
    for _ in range(len(load)):  # as long as the longest chain, at most
        np.minimum.at(due, blocking, due[blocked])

    def rule(load: Load, present: np.ndarray) -> Sequence[np.ndarray]:
        uncovered, in_front, *others = reachable(load, present)
        return uncovered, in_front, -due, *others

    return rule


def _stops(load: Load, by: str) -> np.ndarray:
    """The stop of each box, (n,) float64, so that the lowest is the first; see ``by``."""
    checks.instance("by", by, str, "the name of a column")
    falling = by.startswith("-") and by not in load.extras
    if (name := by[1:] if falling else by) not in load.extras:
        raise ValueError(
            f"by is {by!r}; expected one of the list's other columns: {', '.join(load.extras)}"
        )
    stops = pd.to_numeric(pd.Series(load.extras[name]), errors="coerce").to_numpy(float)
    wrong = np.flatnonzero(~np.isfinite(stops))
    if wrong.size:
        first = wrong[0] if load.ids is None else load.ids[wrong[0]]
        raise ValueError(
            f"{len(wrong)} boxes have no number in {name!r}, the first {first}; "
            "expected the number of its stop for each"
        )
    return -stops if falling else stops
