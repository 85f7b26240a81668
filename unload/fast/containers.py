"""Many containers in arrays: what a pick does in each of them, compiled.

A container of ``unload.env`` looks at all its boxes at each pick. But in a neat load no
box moves, so the order of the boxes by distance is settled when the load is: the 128
nearest are the first 128 that are left, and a box that is unloaded makes room for the next
one in that order, as long as there is one. Here a pick touches these 128 at most.
"""

from typing import NamedTuple

import numpy as np

from unload import task
from unload.fast.ranking import features, rank, remove, replace
from unload.load.boxes import ABOVE, BELOW, BESIDE, CONTACT_TOLERANCE, OVERLAP
from unload.physics.situation import RESOLUTION
from unload.physics.table import EMPTY, FREE_LIFT, HELD_DOWN, absorb, slot_of
from unload.support.compiled import compiled

N_VISIBLE = task.N_VISIBLE
UNKNOWN = -1.0  # in place of a distance that is not in the table


class Containers(NamedTuple):
    """The state of E containers with room for ``capacity`` items and ``links`` contacts each.

    Attributes:
        sizes: (E, 3) float64, inner edges of each container in m.
        tolerances: (E,) float64, ``Load.contact_tolerance`` in m.
        geometry: (E, capacity, 6) float64, centre and edge lengths of each item in m.
        starts, links: (E, 3, capacity + 1) and (E, links) int32, see ``Contacts``.
        present: (E, capacity) bool, False for items that have been unloaded.
        left, unloaded: (E,) int64, how many items there are, and how many there were besides.
        seen: (E, capacity, 3) float32, the scaled positions as observed.
        by_distance: (E, capacity) int32, the items, nearest first.
        visible: (E, 128) int32, the item in each row of the observation, -1 in padded rows.
        values, ranks: (E, 3, 128) float32 and int32, scaled positions and ranks of the rows
            that hold an item.
        observations: (E, 128, 3) float32.
        masks: (E, 128) int8, 0 for rows that failed since the last successful pick, and for
            padded ones.
        failed: (E, 128) float64, how far such a row moved, in m.
    """

    sizes: np.ndarray
    tolerances: np.ndarray
    geometry: np.ndarray
    starts: np.ndarray
    links: np.ndarray
    present: np.ndarray
    left: np.ndarray
    unloaded: np.ndarray
    seen: np.ndarray
    by_distance: np.ndarray
    visible: np.ndarray
    values: np.ndarray
    ranks: np.ndarray
    observations: np.ndarray
    masks: np.ndarray
    failed: np.ndarray


def allocate(num_envs: int, capacity: int, links: int) -> Containers:
    """Empty containers."""
    return Containers(
        sizes=np.zeros((num_envs, 3)),
        tolerances=np.zeros(num_envs),
        geometry=np.zeros((num_envs, capacity, 6)),
        starts=np.zeros((num_envs, 3, capacity + 1), np.int32),
        links=np.zeros((num_envs, links), np.int32),
        present=np.zeros((num_envs, capacity), bool),
        left=np.zeros(num_envs, np.int64),
        unloaded=np.zeros(num_envs, np.int64),
        seen=np.zeros((num_envs, capacity, 3), np.float32),
        by_distance=np.zeros((num_envs, capacity), np.int32),
        visible=np.zeros((num_envs, N_VISIBLE), np.int32),
        values=np.zeros((num_envs, 3, N_VISIBLE), np.float32),
        ranks=np.zeros((num_envs, 3, N_VISIBLE), np.int32),
        observations=np.zeros((num_envs, N_VISIBLE, 3), np.float32),
        masks=np.ones((num_envs, N_VISIBLE), np.int8),
        failed=np.zeros((num_envs, N_VISIBLE)),
    )


@compiled
def start(containers, env, equalize, average, tolerance):
    """Set up all that depends on the geometry, contacts and order of a fresh load."""
    rows = min(containers.left[env], N_VISIBLE)
    for row in range(rows):
        item = containers.by_distance[env, row]
        containers.visible[env, row] = item
        for axis in range(3):
            containers.values[env, axis, row] = containers.seen[env, item, axis]
    containers.visible[env, rows:] = -1
    containers.unloaded[env] = 0
    for axis in range(3):
        rank(containers.values[env, axis, :rows], containers.ranks[env, axis, :rows])
    show(containers, env, rows, equalize, average, tolerance)


@compiled
def show(containers, env, rows, equalize, average, tolerance):
    """Write the observation and the mask of a container that has changed."""
    containers.masks[env, :rows] = 1
    containers.masks[env, rows:] = 0
    features(
        containers.values[env], containers.ranks[env], equalize, average, tolerance,
        containers.observations[env], rows,
    )  # fmt: skip


@compiled
def look_up(containers, actions, digests, micrometres):
    """Each chosen item, (E,) int64, and how far it moves in m, or ``UNKNOWN``, (E,) float64.

    Where the row is padded, the item is -1 and moves by 0.
    """
    items, distances = np.empty(len(actions), np.int64), np.empty(len(actions))
    members = np.empty(containers.present.shape[1], np.int32)
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

        # Under a low ceiling there is no pick, see Physics.lift.
        top = containers.geometry[env, items[env], 2] + containers.geometry[env, items[env], 5] / 2
        if containers.sizes[env, 2] - top < task.LIFT_THRESHOLD - OVERLAP:
            distances[env] = 0
            continue

        # Free boxes and those under three others need no table, see TablePhysics.
        dynamic = movers(containers, env, items[env], members)
        if dynamic == 1 or dynamic > HELD_DOWN:
            distances[env] = FREE_LIFT if dynamic == 1 else 0.0
            continue

        digest = situation_digest(containers, env, members, dynamic)
        slot = slot_of(digests, digest)
        known = digests[slot] != EMPTY
        distances[env] = micrometres[slot] / 1e6 if known else UNKNOWN
    return items, distances


@compiled
def pick(containers, actions, distances, equalize, average, tolerance):
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
        rows = min(containers.left[env], N_VISIBLE)
        for i in range(row, N_VISIBLE - 1):
            visible[i] = visible[i + 1]

        # The last row goes to the nearest item that has not been seen yet, if there is one.
        if rows == N_VISIBLE:
            item = containers.by_distance[env, containers.unloaded[env] + N_VISIBLE - 1]
            visible[N_VISIBLE - 1] = item
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
        show(containers, env, rows, equalize, average, tolerance)
    return rewards


@compiled
def movers(containers, env, item, members):
    """How many boxes a lift moves: the item and all on top of it, at most ``HELD_DOWN + 1``.

    They are written to the start of ``members``, (capacity,) int32.
    """
    starts, links = containers.starts[env], containers.links[env]
    members[0], dynamic, done = item, 1, 0
    while done < dynamic:
        box = members[done]
        done += 1
        for link in range(starts[ABOVE, box], starts[ABOVE, box + 1]):
            if containers.present[env, links[link]] and not _holds(members, dynamic, links[link]):
                members[dynamic] = links[link]
                dynamic += 1
                if dynamic > HELD_DOWN:
                    return dynamic
    return dynamic


@compiled
def situation_digest(containers, env, members, dynamic):
    """The digest of ``Surroundings.situation``.

    ``members`` begins with the ``dynamic`` boxes that ``movers`` found; the rest is overwritten.
    """
    starts, links = containers.starts[env], containers.links[env]
    present, geometry, item = containers.present[env], containers.geometry[env], members[0]
    # The key's order: the item, what rests on it, and what these touch besides, each sorted.
    for end in range(1, dynamic):  # sorts them; numba's sort takes a second more to compile
        _insert(members, 1, end, members[end])
    count = dynamic
    for mover in range(dynamic):
        box = members[mover]
        for kind in (BELOW, BESIDE):
            for link in range(starts[kind, box], starts[kind, box + 1]):
                if present[links[link]] and not _holds(members, count, links[link]):
                    count = _insert(members, dynamic, count, links[link])

    # The floor and the side walls count where a box that can move touches them.
    on_floor = geometry[item, 2] - geometry[item, 5] / 2 <= CONTACT_TOLERANCE
    lowest, highest = np.inf, -np.inf
    for mover in range(dynamic):
        y, width = geometry[members[mover], 1], geometry[members[mover], 4]
        lowest, highest = min(lowest, y - width / 2), max(highest, y + width / 2)
    right = containers.sizes[env, 1]
    at_left, at_right = lowest <= CONTACT_TOLERANCE, highest >= right - CONTACT_TOLERANCE

    # Word for word as digest_of reads Situation.key, without writing the key down.
    digest = np.uint64(2 + on_floor + at_left + at_right + 6 * count)  # words of the key
    digest = absorb(digest, np.int32(dynamic))
    digest = absorb(digest, np.int32(on_floor))
    if on_floor:
        digest = absorb(digest, _micrometres(-geometry[item, 2]))
    if at_left:
        digest = absorb(digest, _micrometres(-geometry[item, 1]))
    if at_right:
        digest = absorb(digest, _micrometres(right - geometry[item, 1]))
    for number in range(count):
        for axis in range(3):
            offset = geometry[members[number], axis] - geometry[item, axis]
            digest = absorb(digest, _micrometres(offset))
        for edge in range(3, 6):
            digest = absorb(digest, _micrometres(geometry[members[number], edge]))
    return max(digest, np.uint64(1))


@compiled
def _micrometres(length):
    return np.int32(np.rint(length / RESOLUTION))


@compiled
def _holds(members, end, box):
    for i in range(end):
        if members[i] == box:
            return True
    return False


@compiled
def _insert(members, first, end, box):
    """Put a box into its place among the sorted ``members[first:end]``; the new end."""
    place = end
    while place > first and members[place - 1] > box:
        members[place] = members[place - 1]
        place -= 1
    members[place] = box
    return end + 1
