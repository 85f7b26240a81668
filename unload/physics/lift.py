"""The lift of one box in its situation, by PyBullet."""

import numpy as np

from unload import task
from unload.physics.bullet import GAP, World
from unload.physics.situation import RESOLUTION, Situation


def lift(world: World, situation: Situation) -> float:
    """Pull the chosen box of a situation; how far it moved, in m.

    The chosen box and all that rests on it are free to move, the rest is fixed. The world
    is left empty, and what was lifted in it before makes no difference, not in one bit.

    Args:
        world: an empty one.
        situation: the box and its surroundings.

    Returns:
        Distance in m, rounded to whole micrometres.
    """
    bodies: list[int] = []
    try:
        for row, box in enumerate(situation.boxes * RESOLUTION):
            mass = task.MASS if row < situation.dynamic else 0.0
            bodies.append(world.add_box(box[:3], slim(box[3:]), mass))
        if situation.floor is not None:
            bodies.append(world.add_box((0, 0, situation.floor * RESOLUTION - 0.5), (9, 9, 1), 0))
        for side in situation.sides:
            outwards = np.sign(side) * 0.5
            bodies.append(world.add_box((0, side * RESOLUTION + outwards, 0), (9, 1, 9), 0))
        return round(world.pull(bodies[0]), 6)
    finally:  # also when interrupted: what stays behind would be in the way of the next lift
        for body in reversed(bodies):
            world.remove(body)


def slim(size: np.ndarray) -> np.ndarray:
    """A box's edges in m with half the gap taken off each of its sides in x and y."""
    return size - np.array([GAP, GAP, 0.0])
