"""The order in which a policy or a rule unloads one load, to the last box."""

import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from unload import task
from unload.agent import policies
from unload.agent.evaluation import Policy
from unload.agent.greedy import SHIPPED, load_policy
from unload.env.container import ContainerEnv
from unload.load.boxes import OVERLAP, Load, check_stacked
from unload.physics.table import TablePhysics, shared_table
from unload.support import checks

BY_NAME = {each.__name__: each for each in (policies.highest, policies.nearest, policies.random)}
Rule = Callable[[Load, np.ndarray], Sequence[np.ndarray]]


def reachable(load: Load, present: np.ndarray) -> tuple[np.ndarray, ...]:
    """The rule of an order that can be carried out from the entrance.

    First what has no box in front of it, then what has none on it, then the foremost, then the
    highest. What is in front of a box stands nearer to the entrance and overlaps it in y and z.

    Args:
        load: its positions, sizes, contacts, ids and extras are what a rule may use.
        present: (n,) bool, the boxes that are left.

    Returns:
        Keys, (n,) each, the most important one first: the box with the largest ones is picked.
    """
    front, top = (load.positions + load.sizes / 2)[:, [0, 2]].T
    # Rounded, so that equal places are equal, however they were computed.
    foremost, highest = np.rint(front / OVERLAP), np.rint(top / OVERLAP)
    return ~load.behind(present), ~load.covered(present), foremost, highest


NAMES = ("reachable", *BY_NAME, *SHIPPED)


def picking_order(
    load: Load,
    policy: str | Path | Policy = "reachable",
    seed: int = 0,
    rule: Rule | None = None,
) -> pd.DataFrame:
    """Unload a load, and write down the picks.

    A policy sees the 128 nearest boxes, each exactly where it is; a rule knows the load. A box
    that has failed is not picked again before another one has been unloaded.

    Args:
        load: see ``unload.read_load``.
        policy: ``"reachable"``, the rule of that name; ``"highest"``, ``"nearest"`` or
            ``"random"``, what ``unload.load_policy`` reads, or a function, see ``unload.policies``.
        seed: of the policy's random numbers; a greedy policy draws none.
        rule: instead of a policy, a function of the load and what is present that returns keys,
            see ``unload.agent.order.reachable``. By stops, the first one first:
            ``lambda load, present: (-load.extras["stop"], *reachable(load, present))``.

    Returns:
        A ``pandas.DataFrame`` with a row for each pick: ``pick``, counted from 1; ``id`` of the
        box, the number of its item if the load has no ids; ``item``, its row in the load;
        ``distance`` in m by which it was lifted; ``unloaded``, False for a pick that failed;
        ``behind``, True if a box stood in front of it, see ``Load.behind``; and the load's
        ``extras``. Boxes are left out only where a container gets stuck: all boxes that the
        policy sees have failed then, and they are the last rows.

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
            policy = BY_NAME.get(policy) or load_policy(policy)
    elif not callable(policy):
        raise TypeError(f"policy is {policy!r}; expected a name, a path or a function")
    if rule is not None and not (policy == "reachable" and callable(rule)):
        raise TypeError(f"rule is {rule!r}; expected a function, and no policy beside it")
    if policy == "reachable":
        picks = _by_rule(load, rule or reachable)
    else:
        picks = _by_policy(load, policy, rng)  # type: ignore[arg-type]

    rows, present = [], np.ones(len(load), bool)
    for item, distance in picks:
        unloaded = distance >= task.LIFT_THRESHOLD
        rows.append((item, distance, unloaded, load.behind(present)[item]))
        present[item] = not unloaded
    table = pd.DataFrame(rows, columns=["item", "distance", "unloaded", "behind"])
    table.insert(0, "pick", np.arange(1, len(table) + 1))
    table.insert(1, "id", table["item"] if load.ids is None else load.ids[table["item"]])
    for name, values in load.extras.items():
        table[f"{name} in the list" if name in table else name] = values[table["item"]]
    return table


def _by_policy(load: Load, policy: Policy, rng: np.random.Generator) -> Iterator[tuple[int, float]]:
    """Items and how far they move, as a policy picks them in the environment."""
    env = ContainerEnv("table", max_picks=sys.maxsize, position_noise=0.0)
    observation, info = env.reset(options={"load": load})
    emptied = False
    while not emptied and info["action_mask"].any():
        chosen = policy(observation[np.newaxis], info["action_mask"][np.newaxis], rng)
        row = int(checks.integer_array("what policy returned", chosen, (1,))[0])
        if row not in np.flatnonzero(info["action_mask"]):
            raise ValueError(f"what policy returned is {row}; expected a row that the mask allows")
        observation, _, emptied, _, info = env.step(row)
        yield int(info["item"]), float(info["distance"])
    env.close()


def _by_rule(load: Load, rule: Rule) -> Iterator[tuple[int, float]]:
    """Items and how far they move, as a rule picks them among all that are present."""
    physics, failed = TablePhysics(shared_table()), np.zeros(len(load), bool)
    physics.reset(load)
    while (allowed := physics.present & ~failed).any():
        returned = rule(load, physics.present.copy())
        try:
            keys = np.array([*returned], np.float64)
        except (TypeError, ValueError) as error:
            raise TypeError(
                f"what rule returned is {returned!r}; expected arrays of numbers"
            ) from error
        keys = checks.finite_array("what rule returned", keys, (None, len(load)))
        candidates = np.flatnonzero(allowed)
        item = int(candidates[np.lexsort(-keys[::-1, candidates])[0]])
        distance = physics.lift(item)
        if distance >= task.LIFT_THRESHOLD:
            physics.remove(item)
            failed[:] = False
        else:
            failed[item] = True
        yield item, distance
    physics.close()
