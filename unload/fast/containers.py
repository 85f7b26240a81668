"""Many containers in arrays: what a pick does in each of them, compiled.

A failed lift moves nothing, so the boxes of a load are sorted by distance once. (With
``FullPhysics("keep")`` boxes move, and are sorted anew after each pick.) The 128 nearest are the
first 128 that are left, and a box that is unloaded makes room for the next one in that order, as
long as there is one. So a pick touches these 128 at most.
"""

from typing import NamedTuple

import numpy as np

from unload import task
from unload.fast.ranking import features, rank, remove, replace
from unload.physics.situation import digest_of, find_movers, find_touching, key_length, write_key
from unload.physics.table import FREE_LIFT, UNKNOWN, find_distance, held_by_rule
from unload.support.compiled import compiled

_N_VISIBLE = task.N_VISIBLE
# In place of what a physics knows, see ``LocalPhysics.known``.
NOTHING_KNOWN = 0, False, np.zeros(0, np.uint64), np.zeros(0, np.int32)


class Containers(NamedTuple):
    """The state of E containers with room for ``capacity`` items and ``links`` contacts each.

    Attributes:
        widths: (E,) float64, inner width of each container in m.
        geometry: (E, capacity, 6) float64, centre and edge lengths of each item in m.
        starts, links: (E, 3, capacity + 1) and (E, links) int32, see ``Contacts``.
        present: (E, capacity) bool, False for items that have been unloaded.
        left, unloaded: (E,) int64, how many items are there, and how many have been taken out.
        seen: (E, capacity, 3) float32, the scaled positions as observed.
        by_distance: (E, capacity) int32, the items that were left when they were last sorted,
            nearest first.
        upcoming: (E,) int64, the index there of the item that is shown next; all before it are
            visible or have been unloaded.
        visible: (E, 128) int32, the item in each row of the observation, -1 in padded rows.
        values, ranks: (E, 3, 128) float32 and int32, scaled positions and ranks of the rows
            that hold an item.
        observations: (E, 128, 3) float32.
        masks: (E, 128) int8, 0 for rows that failed since the last successful pick, and for
            padded ones.
        failed: (E, 128) float64, how far such a row moved, in m.
    """

    widths: np.ndarray
    geometry: np.ndarray
    starts: np.ndarray
    links: np.ndarray
    present: np.ndarray
    left: np.ndarray
    unloaded: np.ndarray
    seen: np.ndarray
    by_distance: np.ndarray
    upcoming: np.ndarray
    visible: np.ndarray
    values: np.ndarray
    ranks: np.ndarray
    observations: np.ndarray
    masks: np.ndarray
    failed: np.ndarray


def allocate(num_envs: int, capacity: int, links: int) -> Containers:
    """Empty containers."""
    return Containers(
        widths=np.zeros(num_envs),
        geometry=np.zeros((num_envs, capacity, 6)),
        starts=np.zeros((num_envs, 3, capacity + 1), np.int32),
        links=np.zeros((num_envs, links), np.int32),
        present=np.zeros((num_envs, capacity), bool),
        left=np.zeros(num_envs, np.int64),
        unloaded=np.zeros(num_envs, np.int64),
        seen=np.zeros((num_envs, capacity, 3), np.float32),
        by_distance=np.zeros((num_envs, capacity), np.int32),
        upcoming=np.zeros(num_envs, np.int64),
        visible=np.zeros((num_envs, _N_VISIBLE), np.int32),
        values=np.zeros((num_envs, 3, _N_VISIBLE), np.float32),
        ranks=np.zeros((num_envs, 3, _N_VISIBLE), np.int32),
        observations=np.zeros((num_envs, _N_VISIBLE, 3), np.float32),
        masks=np.ones((num_envs, _N_VISIBLE), np.int8),
        failed=np.zeros((num_envs, _N_VISIBLE)),
    )


@compiled
def show_nearest(containers, env, equalize, average):
    """Show the nearest items of a container, whose ``by_distance`` has just been written."""
    rows = min(containers.left[env], _N_VISIBLE)
    for row in range(rows):
        item = containers.by_distance[env, row]
        containers.visible[env, row] = item
        for axis in range(3):
            containers.values[env, axis, row] = containers.seen[env, item, axis]
    containers.upcoming[env] = rows
    containers.visible[env, rows:] = -1
    for axis in range(3):
        rank(containers.values[env, axis, :rows], containers.ranks[env, axis, :rows])
    _show(containers, env, rows, equalize, average)


@compiled
def _show(containers, env, rows, equalize, average):
    """Write the observation and the mask of a container that has changed."""
    containers.masks[env, :rows] = 1
    containers.masks[env, rows:] = 0
    values, ranks = containers.values[env], containers.ranks[env]
    features(values, ranks, equalize, average, containers.observations[env], rows)


@compiled
def look_up(containers, actions, held_down, ruled, digests, micrometres):
    """Each chosen item, (E,) int64, and how far it moves in m, or ``UNKNOWN``, (E,) float64.

    Where the row is padded, the item is -1 and moves by 0. A ``held_down`` of 0 stands for a
    physics of which nothing is known (``NOTHING_KNOWN``): then only failed picks that are repeated
    have an answer here.
    """
    items, distances = np.empty(len(actions), np.int64), np.empty(len(actions))
    capacity = containers.present.shape[1]
    members, key = np.empty(capacity, np.int32), np.empty(key_length(capacity), np.int32)
    for env in range(len(actions)):
        row = actions[env]
        items[env] = containers.visible[env, row]
        if items[env] < 0:
            distances[env] = 0
            continue

        # What failed before fails again, as long as nothing has been taken away.
        if containers.masks[env, row] == 0:
            distances[env] = containers.failed[env, row]
            continue

        if held_down == 0:
            distances[env] = UNKNOWN
            continue

        # Free boxes and those under many others need no table, see TablePhysics.
        starts, links = containers.starts[env], containers.links[env]
        present = containers.present[env]
        dynamic = find_movers(starts, links, present, items[env], members, held_down + 1)
        on_top = dynamic - 1
        if on_top == 0 or on_top >= held_down:
            distances[env] = FREE_LIFT if on_top == 0 else 0.0
            continue

        count = find_touching(starts, links, present, members, dynamic)
        geometry, right = containers.geometry[env], containers.widths[env]
        words = write_key(geometry, right, members[:count], dynamic, key)
        micrometre_count = find_distance(digests, micrometres, digest_of(key[:words]))
        if micrometre_count != UNKNOWN:
            distances[env] = micrometre_count / 1e6
        else:
            distances[env] = 0.0 if ruled and held_by_rule(key[:words]) else UNKNOWN
    return items, distances


@compiled
def unload_lifted(containers, actions, distances, equalize, average):
    """Unload the items that moved far enough; the rewards, (E,) float64."""
    rewards = np.empty(len(actions))
    for env in range(len(actions)):
        row = actions[env]
        if distances[env] < task.LIFT_THRESHOLD:
            rewards[env] = -1
            containers.masks[env, row] = 0
            containers.failed[env, row] = distances[env]
            continue

        # The item leaves its row, and the later ones move up.
        rewards[env] = 1
        visible = containers.visible[env]
        containers.present[env, visible[row]] = False
        containers.left[env] -= 1
        containers.unloaded[env] += 1
        rows = min(containers.left[env], _N_VISIBLE)
        for i in range(row, _N_VISIBLE - 1):
            visible[i] = visible[i + 1]

        # The last row goes to the nearest item that has not been seen yet, if there is one.
        if rows == _N_VISIBLE:
            item = containers.by_distance[env, containers.upcoming[env]]
            containers.upcoming[env] += 1
            visible[_N_VISIBLE - 1] = item
            for axis in range(3):
                replace(
                    containers.values[env, axis], containers.ranks[env, axis], row,
                    containers.seen[env, item, axis],
                )  # fmt: skip
        else:
            visible[rows] = -1
            for axis in range(3):
                values, ranks = containers.values[env, axis], containers.ranks[env, axis]
                remove(values[: rows + 1], ranks[: rows + 1], row)

        # After a success no row counts as failed.
        _show(containers, env, rows, equalize, average)
    return rewards
