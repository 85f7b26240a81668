"""The lift of one box in its situation, by PyBullet."""

import numpy as np

from unload import task
from unload.bullet import GAP, World
from unload.situation import RESOLUTION, Situation


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
    boxes = situation.boxes * RESOLUTION
    bodies = [
        world.add_box(box[:3], slim(box[3:]), task.MASS if row < situation.dynamic else 0.0)
        for row, box in enumerate(boxes)
    ]
    if situation.floor is not None:
        bodies.append(world.add_box((0, 0, situation.floor * RESOLUTION - 0.5), (9, 9, 1), 0))
    for side in situation.sides:
        outwards = np.sign(side) * 0.5
        bodies.append(world.add_box((0, side * RESOLUTION + outwards, 0), (9, 1, 9), 0))
    distance = world.pull(bodies[0])
    for body in reversed(bodies):
        world.remove(body)
    return round(distance, 6)


def slim(size: np.ndarray) -> np.ndarray:
    """A box's edges in m with half the gap taken off each of its sides in x and y."""
    return size - np.array([GAP, GAP, 0.0])
