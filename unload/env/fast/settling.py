"""Boxes that rise a little when what rests on them is taken away, compiled.

A box in a stack has sunk the farther, the more boxes rest on it. Here its height lies between
the two that were simulated, in the full load and with nothing on it, in proportion to the
number of boxes above it that are still there.
"""

from typing import NamedTuple

import numpy as np

from unload import task
from unload.env.fast.containers import N_VISIBLE, show
from unload.env.fast.ranking import rank
from unload.load.contacts import BELOW
from unload.support.compiled import compiled

HEIGHT = float(task.CONTAINER[2])


class Settling(NamedTuple):
    """What is known of E containers besides ``Containers``.

    Attributes:
        carried: (E, capacity, 2) int32, how many of the boxes that stood above each item,
            directly or upon others, are there now, and how many there were in the full load.
        offsets: (E, capacity, 2) float64, m along z: in the full load, and with nothing above.
    """

    carried: np.ndarray
    offsets: np.ndarray


def allocate(num_envs: int, capacity: int) -> Settling:
    """Of empty containers."""
    shape = num_envs, capacity, 2
    return Settling(np.zeros(shape, np.int32), np.zeros(shape))


@compiled
def start(containers, settling, env):
    """Count what the items of a fresh load carry."""
    below = np.empty(containers.present.shape[1], np.int32)
    settling.carried[env] = 0
    for item in range(containers.left[env]):
        for number in range(_find_below(containers, env, item, below)):
            settling.carried[env, below[number]] += 1


@compiled
def relieve(containers, settling, items, rewards, equalize, average, tolerance):
    """Let rise what each item carried that has just been unloaded, and show it.

    Args:
        containers, settling: after the picks.
        items, rewards: (E,) of the picks.
        equalize, average, tolerance: see ``containers.show``.
    """
    below = np.empty(containers.present.shape[1], np.int32)
    rising = np.zeros(containers.present.shape[1], np.bool_)
    for env in range(len(items)):
        if rewards[env] <= 0:
            continue
        count = _find_below(containers, env, items[env], below)
        for number in range(count):
            box = below[number]
            settling.carried[env, box, 0] -= 1
            containers.seen[env, box, 2] = _seen(containers, settling, env, box)
            rising[box] = True
        rows = min(containers.left[env], N_VISIBLE)
        for row in range(rows):
            box = containers.visible[env, row]
            if rising[box]:
                containers.values[env, 2, row] = containers.seen[env, box, 2]
        rising[below[:count]] = False
        rank(containers.values[env, 2, :rows], containers.ranks[env, 2, :rows])
        show(containers, env, rows, equalize, average, tolerance)


@compiled
def _seen(containers, settling, env, box):
    """The scaled height at which a box is seen."""
    now, once = settling.carried[env, box]
    loaded, free = settling.offsets[env, box]
    height = containers.geometry[env, box, 2] + free + (loaded - free) * now / once
    return np.float32(min(max(2 / HEIGHT * height - 1, -1.0), 1.0))


@compiled
def _find_below(containers, env, item, below):
    """Write the boxes of the full load below an item, directly or not; return how many."""
    starts, links = containers.starts[env], containers.links[env]
    count, box = 0, item
    for done in range(len(below)):
        for link in range(starts[BELOW, box], starts[BELOW, box + 1]):
            known = False
            for number in range(count):
                known |= below[number] == links[link]
            if not known:
                below[count] = links[link]
                count += 1
        if done == count:
            break
        box = below[done]
    return count
