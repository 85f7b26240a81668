"""Lifts asked of ``full``, from a state of a container: in a fresh world, or in one that drifts.

A fresh world holds the state's boxes on the load's exact grid and has seen no other lift. A
drifting one has lived through picks with ``after_pick="keep"`` or ``"restore_failure"``: its
boxes have moved a little, as they do in any simulation of everything.
"""

from collections.abc import Callable
from functools import partial
from hashlib import blake2b
from typing import NamedTuple

import numpy as np

from unload import task
from unload.load.boxes import Load
from unload.load.substacks import WALLS
from unload.physics.bullet import SETTINGS
from unload.physics.full import FullPhysics
from unload.physics.situation import Surroundings

NEAR_WALLS = 5  # the item's own wall and two on each side
LIVED, ASKED = 10, 20  # picks that a drifting world lives through before lifts count; and then
# How often a drifting world is asked for items with 0, 1, 2, and 3 or more boxes on top. Half
# are free, because only successes let time pass with "restore_failure".
ODDS = (0.5, 0.2, 0.2, 0.1)


class State(NamedTuple):
    """A container on its way to be unloaded.

    Attributes:
        policy, seed, picks: how it got there, see ``agreement.container_states``.
        load: what it was filled with.
        present: (n,) bool, the items that are left.
        visible: (128,) int64, the items that can be picked.
    """

    policy: str
    seed: int
    picks: int
    load: Load
    present: np.ndarray
    visible: np.ndarray


def boxes_left(state: State, wall: int, walls: int) -> tuple[Load, np.ndarray]:
    """The boxes that are left in a state, in some item walls, and their numbers in its load.

    Args:
        state: of the container.
        wall: in the middle.
        walls: how many, ``NEAR_WALLS`` (fewer where the load ends) or ``WALLS`` for all.
    """
    load = state.load
    near = (abs(load.walls - wall) <= NEAR_WALLS // 2) | (walls == WALLS)
    items = np.flatnonzero(state.present & near)
    fields = load.positions, load.sizes, load.packages, load.walls
    return Load(*(field[items] for field in fields)), items


def fresh_job(state: State, item: int, walls: int) -> tuple[dict, Callable[[], float]]:
    """Question and computation of one lift in a fresh world, for ``results.keep_all``.

    In a world that has seen other lifts, the answer depends on them (by a millimetre or so),
    and so on the order in which the items are lifted.

    Args:
        state: of the container.
        item: to lift.
        walls: how many are simulated, the item's own in the middle.
    """
    left, items = boxes_left(state, state.load.walls[item], walls)
    box = int(np.searchsorted(items, item))
    return _question(left, item=box), partial(fresh_distance, left, box)


def fresh_distance(load: Load, item: int) -> float:
    """How far ``full`` moves an item of a load that has seen no other lift, in m."""
    physics = FullPhysics()
    physics.reset(load)
    distance = physics.lift(item)
    physics.close()
    return distance


def drifting_job(state: State, after_pick: str, seed: int) -> tuple[dict, Callable[[], list]]:
    """Question and computation of the picks in one drifting world, for ``results.keep_all``.

    Args:
        state: of the container. ``NEAR_WALLS`` are simulated, around a visible item.
        after_pick: ``"keep"`` or ``"restore_failure"``, see ``FullPhysics``.
        seed: of the walls and of the picks.
    """
    rng = np.random.default_rng(seed)
    left, items = boxes_left(state, state.load.walls[rng.choice(state.visible)], NEAR_WALLS)
    visible = np.flatnonzero(np.isin(items, state.visible))
    question = _question(
        left, visible=visible.tolist(), after_pick=after_pick, seed=seed, odds=ODDS,
        picks=LIVED + ASKED,
    )  # fmt: skip
    return question, partial(drifting_picks, left, items, visible, after_pick, rng)


def drifting_picks(
    load: Load, numbers: np.ndarray, visible: np.ndarray, after_pick: str, rng: np.random.Generator
) -> list[tuple[int, float, float]]:
    """Picks in one world of ``full`` that keeps what they make of it.

    Args:
        load: what the world is filled with.
        numbers: (n,) int64, what its items are called.
        visible: the items that may be picked, none of them twice.
        after_pick: see ``FullPhysics``.
        rng: draws the items, by ``ODDS``.

    Returns:
        Of each pick: the item's name; how far it moved, in m; and the drift before it, in m:
        the median distance of the boxes left from where the load has them.
    """
    physics, tried, picks = FullPhysics(after_pick), set(), []
    physics.reset(load)
    surroundings = Surroundings(load, physics.present)
    while len(picks) < LIVED + ASKED and len(tried) < len(visible):
        open_to_try = [item for item in visible.tolist() if item not in tried]
        item = _draw(open_to_try, surroundings, rng)
        moved = np.linalg.norm(physics.positions() - load.positions, axis=1)
        drift = float(np.median(moved[physics.present]))
        distance = physics.lift(item)
        if distance >= task.LIFT_THRESHOLD:
            physics.remove(item)
        tried.add(item)
        picks.append((int(numbers[item]), distance, drift))
    physics.close()
    return picks


def _draw(items: list[int], surroundings: Surroundings, rng: np.random.Generator) -> int:
    """One of the items: first how many boxes are on it, by ``ODDS``, then which."""
    kinds = np.array([min(len(surroundings.on_top(item)), len(ODDS) - 1) for item in items])
    odds = np.array([chance * (kinds == kind).any() for kind, chance in enumerate(ODDS)])
    kind = rng.choice(len(ODDS), p=odds / odds.sum())
    return items[rng.choice(np.flatnonzero(kinds == kind))]


def _question(load: Load, **rest) -> dict:
    boxes = blake2b(load.positions.tobytes() + load.sizes.tobytes(), digest_size=16).hexdigest()
    return {"settings": SETTINGS, "boxes": boxes} | rest
