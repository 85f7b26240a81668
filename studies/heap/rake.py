"""The bulk pick: a rake drags one box towards the door, and others come with it."""

from dataclasses import dataclass

import numpy as np

from studies.heap.boxes import DOOR, REAR, WIDTH, Heap
from unload import task
from unload.physics.bullet import World
from unload.support import checks

SPEED = 1.0  # m/s, a slow conveyor's
FORCE = 60.0  # N: six boxes' weight, enough for several boxes, too little for half of the heap
REACH = 0.7  # m: the longest edge of a box, so that the box is past the place that it held
TIME = 1.0  # s, 1.4 times what the reach takes at full speed
CAME = 0.9 * REACH  # m: moved as far, the dragged box counts as unloaded, wherever it lies
REST = 0.5  # s: free fall from 1.2 m
RESTS = 4  # at most, as long as boxes are unloaded or move
STILL = 0.2  # m/s; a toppling box is faster, a creeping one slower
FALL = 0.5  # m: a box that drops deeper may be damaged
# Name → time step in s, and solver iterations. Coarse takes a third of the time of whole.
PHYSICS = {"whole": (1 / 240, 50), "coarse": (1 / 120, 20)}


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a pick has done.

    Attributes:
        heap: what is left.
        unloaded: (n,) bool, of the boxes before.
        fallen: (n,) bool, others than the dragged one that dropped by more than ``FALL``,
            whether they were unloaded or not.
        moved: m, how far the dragged box came along x.
        came: whether that was at least ``CAME``.
    """

    heap: Heap
    unloaded: np.ndarray
    fallen: np.ndarray
    moved: float
    came: bool


def add_walls(world: World) -> None:
    """Add floor, rear wall and both side walls, each 1 m thick and reaching beyond the door."""
    middle = (REAR + DOOR) / 2
    for position, size in (
        ((middle, WIDTH / 2, -0.5), (40, 40, 1)),
        ((REAR - 0.5, WIDTH / 2, 5), (1, WIDTH + 2, 10)),
        ((middle, -0.5, 5), (12, 1, 10)),
        ((middle, WIDTH + 0.5, 5), (12, 1, 10)),
    ):
        world.add_box(position, size, 0)


def fill(world: World, heap: Heap, mass: float) -> dict[int, int]:
    """Let a world hold the walls and the boxes of a heap alone; return their bodies by number.

    The mass is that of each box in kg; 0 makes them immovable.
    """
    world.clear()
    add_walls(world)
    boxes = zip(heap.positions, heap.sizes, heap.orientations)
    return {
        number: world.add_box(place, size, mass, turn)
        for number, (place, size, turn) in enumerate(boxes)
    }


def drag(world: World, body: int) -> float:
    """Drag a body towards the door by its centre of mass, and stop it in that direction.

    A controller holds ``SPEED``, as far as ``FORCE`` allows, until the body has moved by
    ``REACH`` or ``TIME`` is over. Return how far it came along x, in m.
    """
    start = world.pose(body)[0][0]
    for _ in range(round(TIME / world.time_step)):
        if world.pose(body)[0][0] - start >= REACH:
            break
        # What would bring the body to its speed within this step, if nothing resisted.
        wanted = task.MASS * (SPEED - world.client.getBaseVelocity(body)[0][0]) / world.time_step
        force = (min(max(wanted, -FORCE), FORCE), 0.0, 0.0)
        world.step(world.time_step, body, force)
    moved = world.pose(body)[0][0] - start
    linear, angular = world.client.getBaseVelocity(body)
    world.client.resetBaseVelocity(body, (0, *linear[1:]), angular)
    return moved


class Rake:
    """Picks boxes of heaps in one PyBullet client; ``HeapEnv`` describes a pick.

    What falls while it rests counts for the pick that has caused it. Of 160 random picks 14 % used
    up all rests; what still moves then stands where it is, at rest, when the next pick begins.

    Every pick builds the world anew from the heap, so that it depends on nothing else, to the
    bit: not on earlier picks, of which PyBullet would remember contacts.

    Args:
        physics: ``"whole"``, PyBullet's default of 240 Hz and 50 iterations of the solver, or
            ``"coarse"``, 120 Hz and 20 iterations.
    """

    def __init__(self, physics: str = "whole") -> None:
        checks.one_of("physics", physics, PHYSICS)
        time_step, iterations = PHYSICS[physics]
        self._world = World(time_step, iterations=iterations)

    def pick(self, heap: Heap, box: int) -> Outcome:
        """Drag one box and see what comes."""
        world, edge = self._world, heap.edge()
        bodies = fill(world, heap, task.MASS)
        moved = drag(world, bodies[box])
        came = moved >= CAME
        unloaded = np.zeros(len(heap), bool)
        positions, orientations = heap.positions.copy(), heap.orientations.copy()
        for _ in range(RESTS):
            world.step(REST)
            for number, body in bodies.items():
                positions[number], orientations[number] = world.pose(body)
            gone = positions[:, 0] > edge
            gone[box] |= came  # the rake holds it, wherever it lies
            gone &= ~unloaded
            velocities = [world.client.getBaseVelocity(body)[0] for body in bodies.values()]
            speeds = [np.linalg.norm(velocity) for velocity in velocities]
            if not gone.any() and max(speeds, default=0) < STILL:
                break
            unloaded |= gone
            for number in np.flatnonzero(gone).tolist():
                world.remove(bodies.pop(number))
        fallen = heap.positions[:, 2] - positions[:, 2] > FALL
        fallen[box] = False
        after = Heap(positions, orientations, heap.sizes, heap.packages).only(~unloaded)
        return Outcome(after, unloaded, fallen, float(moved), bool(came))
