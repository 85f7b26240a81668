"""Containers in arrays: what a lift asks of the table."""

import numpy as np

from unload.fast import containers
from unload.physics.situation import Surroundings
from unload.physics.table import FREE_LIFT, LiftTable


def test_distances_are_looked_up_or_unknown(boxes):
    heights = (0.2, 0.6, 1.0, 1.4)
    load = boxes(*((1.2, height) for height in heights))
    everywhere, table = np.ones(4, bool), LiftTable()
    # The second of two containers, which have room for more than this load.
    state = containers.allocate(2, 7, len(load.contacts.boxes) + 1)
    state.widths[1], state.ceilings[1] = load.container[1], load.ceiling
    state.geometry[1, :4] = np.hstack([load.positions, load.sizes])
    state.starts[1, :, :5], state.links[1, :-1] = load.contacts
    state.present[1, :4] = everywhere
    state.visible[:], state.masks[:] = -1, 1
    state.visible[1, :4] = range(4)
    table.add(Surroundings(load, everywhere).situation(2), 0.25)
    distances = (0, containers.UNKNOWN, 0.25, FREE_LIFT)  # from the lowest box, under three others
    for row, item, distance in (*zip(range(4), range(4), distances), (4, -1, 0)):
        items, distances = containers.look_up(state, np.array([5, row]), *table.slots)
        assert items.tolist() == [-1, item] and distances.tolist() == [0, distance]
    state.masks[1, 1], state.failed[1, 1] = 0, 0.1  # failed before, by so much
    assert containers.look_up(state, np.array([5, 1]), *table.slots)[1].tolist() == [0, 0.1]
