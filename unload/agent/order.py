"""The order in which a policy or a rule unloads one load, to the last box."""

import logging
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, nullcontext
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from unload import task
from unload.agent import policies
from unload.agent.policies import Policy
from unload.env.observation import nearest, scale
from unload.load.boxes import OVERLAP, Load, check_stacked
from unload.physics.base import Force, Physics, low_ceiling
from unload.physics.full import Name, make_physics
from unload.physics.table import too_heavy
from unload.support import checks
from unload.support.files import POLICIES

LOGGER = logging.getLogger(__name__)
BY_NAME = {each.__name__: each for each in (policies.highest, policies.nearest, policies.random)}
NAMES = ("reachable", *BY_NAME, *POLICIES)
FEW = 5  # ids of boxes that are named
Rule = Callable[[Load, np.ndarray], Sequence[np.ndarray]]
# Of a load, of the boxes that are present, and of those that may be picked: one of the latter, or
# None if whoever chooses sees none.
Choice = Callable[[Load, np.ndarray, np.ndarray], int | None]


def reachable(load: Load, present: np.ndarray) -> tuple[np.ndarray, ...]:
    """The rule of an order that can be carried out from the entrance.

    First what has no box on it, then what has none in front of it, then the foremost, then the
    highest. What is in front of a box stands nearer to the entrance and overlaps it in y and z.

    Args:
        load: its positions, sizes, masses, contacts, ids and extras are what a rule may use.
        present: (n,) bool, the boxes that are left.

    Returns:
        Keys, (n,) each, the most important one first: the box with the largest ones is picked.
    """
    front, top = (load.positions + load.sizes / 2)[:, [0, 2]].T
    # Rounded, so that equal places are equal, however they were computed.
    foremost, highest = np.rint(front / OVERLAP), np.rint(top / OVERLAP)
    return ~load.covered(present), ~load.behind(present), foremost, highest


def picking_order(
    load: Load,
    policy: str | Path | Policy = "reachable",
    seed: int = 0,
    rule: Rule | None = None,
    by: str | None = None,
    physics: Name | Physics = "table",
    force: Force = task.PICK_FORCE,
) -> pd.DataFrame:
    """Unload a load, and write down the picks.

    A policy sees the 128 nearest boxes, each exactly where it is; a rule knows the load. A box
    that has failed is not picked again before another one has been unloaded. How many boxes the
    ceiling or their weight makes unliftable is logged first; rules pick these last, and nothing
    that lies under them.

    Args:
        load: see ``unload.read_load``.
        policy: ``"reachable"``, the rule of that name; ``"highest"``, ``"nearest"`` or
            ``"random"``, what ``unload.load_policy`` reads, or a function, see ``unload.policies``.
        seed: of the policy's random numbers; a greedy policy draws none.
        rule: instead of a policy, a function of the load and what is present that returns keys,
            see ``unload.agent.order.reachable``. What can be reached, the heaviest first::

                def heaviest(load, present):
                    uncovered, in_front, *others = reachable(load, present)
                    return uncovered, in_front, load.masses, *others

        by: instead of a rule, a name in ``load.extras``, such as ``"stop"``: what can be reached,
            the lowest value first, or with ``"-stop"`` the highest. Boxes of later stops come out
            early only where they stand in the way of what can come out.
        physics: ``"table"``, ``"local"``, ``"full"`` or a ``Physics``, see ``ContainerEnv``.
        force: N, the strongest pull, see ``Physics``; ``"auto"``: as much as each box needs.

    Returns:
        A ``pandas.DataFrame`` with a row for each pick: ``pick``, counted from 1; ``id`` of the
        box, the number of its item if the load has no ids; ``item``, its row in the load;
        ``distance`` in m by which it was lifted; ``unloaded``, False for a pick that failed;
        ``behind``, True if a box stood in front of it, see ``Load.behind``; and the load's
        ``extras``. Boxes are left out only where a container gets stuck: all boxes that the
        policy sees, or that a rule may pick, have failed then, and they are the last rows.

    Raises:
        TypeError, ValueError: an argument is not as described, or ``policy`` returns
            something other than a row that its mask allows, or ``rule`` other than keys.
        FileNotFoundError: there is no such policy; the message lists the names.
    """
    check_stacked(load)
    rng = np.random.default_rng(checks.integer("seed", seed, 0))
    if isinstance(policy, (str, Path)):
        policy = str(policy)
        if policy not in NAMES and not Path(policy).is_file():
            raise FileNotFoundError(
                f"policy is {policy!r}; expected a .safetensors file of a policy, or one of "
                + ", ".join(map(repr, NAMES))
            )
        if policy != "reachable":
            policy = BY_NAME.get(policy) or _learned(policy)
    elif not callable(policy):
        raise TypeError(f"policy is {policy!r}; expected a name, a path or a function")
    for name, given in (("rule", rule), ("by", by)):
        if given is not None and policy != "reachable":
            raise TypeError(f"{name} is {given!r}; expected no policy beside it")
    if rule is not None and not (callable(rule) and by is None):
        raise TypeError(f"rule is {rule!r}; expected a function, and no by beside it")

    # Who handed a physics over closes it.
    own = make_physics(physics, force=force)
    with nullcontext() if own is physics else closing(own):
        own.reset(load)
        hopeless = _hopeless(load, own.force)
        if policy == "reachable":
            ruled = rule or (reachable if by is None else _by_stop(load, by, hopeless))
            choose = partial(_by_rule, ruled, hopeless)
        else:
            choose = partial(_by_policy, policy, rng)  # type: ignore[arg-type]
        table = pd.DataFrame(_picks(own, choose), columns=["item", "distance", "behind"])

    table.insert(2, "unloaded", table["distance"] >= task.LIFT_THRESHOLD)
    table.insert(0, "pick", np.arange(1, len(table) + 1))
    table.insert(1, "id", table["item"] if load.ids is None else load.ids[table["item"]])
    for name, values in load.extras.items():
        table[f"{name} in the list" if name in table else name] = values[table["item"]]
    return table


def _learned(name: str) -> Policy:
    with checks.needed_for(f"policy {name!r}"):
        from unload.agent.greedy import load_policy  # here, because rules need no PyTorch
    return load_policy(name)


def _picks(physics: Physics, choose: Choice) -> Iterator[tuple[int, float, bool]]:
    """Items, how far they move, and whether others stand in front, until nothing can be chosen."""
    load, failed = physics.load, np.zeros(len(physics.load), bool)
    while (allowed := physics.present & ~failed).any():
        item = choose(load, physics.present.copy(), allowed)
        if item is None:
            return
        distance, behind = physics.lift(item), load.behind(physics.present)[item]
        if distance >= task.LIFT_THRESHOLD:
            physics.remove(item)
            failed[:] = False
        else:
            failed[item] = True
        yield item, distance, behind


def _by_policy(
    policy: Policy, rng: np.random.Generator, load: Load, present: np.ndarray, allowed: np.ndarray
) -> int | None:
    """What a policy picks of the nearest items, which it sees as in the environment."""
    items = np.flatnonzero(present)
    items = items[nearest(load.positions[items], container=load.container)]
    if not allowed[items].any():
        return None
    mask = np.zeros((1, task.N_VISIBLE), np.int8)
    seen = np.full((1, task.N_VISIBLE, 3), task.PADDING, np.float32)
    mask[0, : len(items)] = allowed[items]
    seen[0, : len(items)] = scale(load.positions[items], load.container)
    chosen = checks.integer_array("what policy returned", policy(seen, mask, rng), (1,))
    if chosen[0] not in np.flatnonzero(mask):
        wanted = "expected a row that the mask allows"
        raise ValueError(f"what policy returned is {chosen[0]}; {wanted}")
    return int(items[chosen[0]])


def _by_rule(
    rule: Rule, hopeless: np.ndarray, load: Load, present: np.ndarray, allowed: np.ndarray
) -> int | None:
    """What a rule picks: nothing under boxes that nobody can lift, and these last."""
    returned = rule(load, present)
    try:
        keys = np.array([*returned], np.float64)
    except (TypeError, ValueError) as error:
        raise TypeError(
            f"what rule returned is {returned!r}; expected arrays of numbers"
        ) from error
    keys = checks.finite_array("what rule returned", keys, (None, len(load)))
    stuck = _stuck(load, hopeless & present)
    for worth in (allowed & ~stuck, allowed & hopeless):
        if (items := np.flatnonzero(worth)).size:
            return int(items[np.lexsort(-keys[::-1, items])[0]])
    return None


def _stuck(load: Load, hopeless: np.ndarray) -> np.ndarray:
    """(n,) bool, boxes that nobody can lift, and all that lies under them."""
    stuck, (lower, upper) = hopeless.copy(), load.covers
    while not stuck[lower[stuck[upper]]].all():
        stuck[lower[stuck[upper]]] = True
    return stuck


def _hopeless(load: Load, force: float) -> np.ndarray:
    """(n,) bool, True for boxes that no order unloads; they are logged."""
    low, heavy = low_ceiling(load), too_heavy(load, force)
    for boxes, problem in (
        (low, f"have less than {task.LIFT_THRESHOLD} m above them"),
        (heavy, f"are too heavy for {force:g} N; a force of 'auto' lifts each"),
    ):
        if boxes.any():
            LOGGER.warning("%s", _named(load, np.flatnonzero(boxes), problem))
    return low | heavy


def _named(load: Load, items: np.ndarray, problem: str) -> str:
    """A sentence that says how many boxes have a problem, and names the first."""
    ids = ", ".join(str(i if load.ids is None else load.ids[i]) for i in items[:FEW])
    more = ", ..." if len(items) > FEW else ""
    return f"{len(items)} of {len(load)} boxes {problem}: {ids}{more}"


def _by_stop(load: Load, by: str, hopeless: np.ndarray) -> Rule:
    """The rule of an order by stops that can be carried out.

    A box is due at the first of the stops of all that it stands in front of, lies on, or keeps
    from coming out over others; so no box comes out before its stop that need not. What stays in
    the container at any rate has no stop.
    """
    stops, numbers = stop_numbers(load, by)
    due = np.where(_stuck(load, hopeless), len(stops), numbers)
    blocked, blocking = np.hstack([load.fronts, load.covers])
    while True:
        sooner = due.copy()
        np.minimum.at(sooner, blocking, due[blocked])
        if np.array_equal(sooner, due):
            break
        due = sooner

    def rule(load: Load, present: np.ndarray) -> Sequence[np.ndarray]:
        uncovered, in_front, *others = reachable(load, present)
        return uncovered, in_front, -due, *others

    return rule


def stop_numbers(load: Load, by: str) -> tuple[np.ndarray, np.ndarray]:
    """The stops in order, (k,), and the index of each box's stop, (n,) int64.

    Args:
        load: with extras.
        by: the name of one, or that with a minus before it, see ``picking_order``.
    """
    checks.instance("by", by, str, "a name in the load's extras")
    if not load.extras:
        raise ValueError(f"by is {by!r}; expected None, because the list has no other columns")
    falling = by not in load.extras and by.startswith("-")
    name = checks.one_of("by", by[1:] if falling else by, load.extras)
    values = load.extras[name]
    missing = np.flatnonzero(pd.isna(values) | (values == ""))
    if missing.size:
        raise ValueError(_named(load, missing, f"have no {name!r}; expected one for each box"))
    stops, numbers = np.unique(values, return_inverse=True)
    if stops.dtype.kind not in "biuf":  # texts: "stop 2" comes before "stop 10"
        order = sorted(range(len(stops)), key=lambda stop: _parts(str(stops[stop])))
        stops, numbers = stops[order], np.argsort(order)[numbers]
    return (stops[::-1], len(stops) - 1 - numbers) if falling else (stops, numbers)


def _parts(text: str) -> list:
    return [int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", text)]


def stops_of(load: Load, order: pd.DataFrame, by: str) -> pd.DataFrame:
    """What an order means to each stop.

    Args:
        load, by: as for ``picking_order``, which returned ``order``.

    Returns:
        A row for each stop in its turn: ``stop``; ``boxes``, how many it has; ``others_first``,
        how many of later stops come out before its last one.
    """
    stops, numbers = stop_numbers(load, by)
    turns = numbers[order.loc[order["unloaded"], "item"]]
    rows = []
    for number, stop in enumerate(stops):
        until = turns[: np.flatnonzero(turns == number).max(initial=-1) + 1]
        rows.append((stop, (numbers == number).sum(), (until > number).sum()))
    return pd.DataFrame(rows, columns=["stop", "boxes", "others_first"])
