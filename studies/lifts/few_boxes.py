"""Lifts of a few boxes that notebook 10 looks at: in a wall, and with one box partly on top."""

from collections.abc import Sequence

import numpy as np

import unload
from studies.policies.comparison import front_walls
from unload import task
from unload.physics.bullet import TIME_STEP, World, slim
from unload.physics.local import LocalPhysics
from unload.physics.situation import RESOLUTION, Situation

STICKS_OUT = 100  # μm, more than rounding


def top_lifts(gap: float, seed: int) -> np.ndarray:
    """How far each box of a wall's top layer is lifted, in m, where all boxes can move.

    Args:
        gap: m, by which each box is narrower along x and y.
        seed: of the load whose foremost wall it is.
    """
    wall = front_walls(unload.stack_load(np.random.default_rng(seed)), 1)
    tops = (wall.positions + wall.sizes / 2)[:, 2]
    moved = []
    for number in np.flatnonzero(tops > tops.max() - 0.001):
        world = World()
        world.add_box((3.5, 1.25, -0.5), (9, 9, 1), mass=0)  # the floor
        for y in (-0.5, 3.0):  # the side walls of the container
            world.add_box((3.5, y, 1.25), (9, 1, 2.5), mass=0)
        boxes = zip(wall.positions, wall.sizes - (gap, gap, 0))
        bodies = [world.add_box(place, size, task.MASS) for place, size in boxes]
        moved.append(world.pull(bodies[number]))
        world.close()
    return np.array(moved)


def partly_on_top(situation: Situation) -> bool:
    """Whether exactly one box rests on the chosen one, and sticks out beyond it along y."""
    if situation.on_top != 1:
        return False
    chosen, top = situation.boxes[:2]
    return bool(abs(top[1]) + top[4] / 2 > chosen[4] / 2 + STICKS_OUT)


def hard_situations(loads: int, seed: int) -> list[Situation]:
    """The distinct situations of ``partly_on_top`` while random loads are unloaded.

    Half of the free boxes are taken away at a time, until no more are left than are visible.
    """
    rng, physics = np.random.default_rng(seed), LocalPhysics()
    found: dict[bytes, Situation] = {}
    for _ in range(loads):
        physics.reset(unload.stack_load(rng))
        while physics.present.sum() > task.N_VISIBLE:
            present = np.flatnonzero(physics.present).tolist()
            around = {item: physics.surroundings.situation(item) for item in present}
            found |= {each.key: each for each in around.values() if partly_on_top(each)}
            free = [item for item, each in around.items() if each.on_top == 0]
            for item in rng.choice(free, len(free) // 2 + 1, replace=False):
                physics.remove(item)
    return list(found.values())


def record(situation: Situation, times: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
    """Lift the chosen box of a situation away from floor and side walls, and note all poses.

    Returns:
        Sizes (boxes, 2) and poses (times, boxes, 3), as seen from the front: along y and z in m,
        and the angle about x.
    """
    world, boxes, poses = World(), situation.boxes * RESOLUTION, []
    masses = np.where(np.arange(len(boxes)) < situation.dynamic, task.MASS, 0)
    bodies = [world.add_box(b[:3], slim(b[3:]), mass) for b, mass in zip(boxes, masses)]
    # Whole numbers of steps between the moments.
    for steps in np.diff(np.rint(np.divide(times, TIME_STEP)), prepend=0):
        world.pull(bodies[0], seconds=steps * TIME_STEP)
        now = [world.pose(body) for body in bodies]
        poses.append([(p[1], p[2], 2 * np.arctan2(q[0], q[3])) for p, q in now])
    world.close()
    return boxes[:, 4:], np.array(poses)
