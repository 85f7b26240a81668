"""Lifts asked of ``full``, from a state of a container, each in a fresh world.

Such a world holds the state's boxes on the load's exact grid and has seen no other lift.
"""

from collections.abc import Callable
from functools import partial
from hashlib import blake2b
from typing import NamedTuple

import numpy as np

from unload.load.boxes import Load
from unload.load.substacks import WALLS
from unload.physics.bullet import SETTINGS
from unload.physics.full import FullPhysics

NEAR_WALLS = 5  # the item's own wall and two on each side


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
    boxes = blake2b(left.positions.tobytes() + left.sizes.tobytes(), digest_size=16).hexdigest()
    question = {"settings": SETTINGS, "boxes": boxes, "item": box}
    return question, partial(fresh_distance, left, box)


def fresh_distance(load: Load, item: int) -> float:
    """How far ``full`` moves an item of a load that has seen no other lift, in m."""
    physics = FullPhysics()
    physics.reset(load)
    distance = physics.lift(item)
    physics.close()
    return distance
