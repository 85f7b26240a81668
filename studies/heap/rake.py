"""The bulk pick: a rake drags one box towards the door, and others come with it."""

from dataclasses import dataclass

import numpy as np

from studies.heap.boxes import DOOR, FARTHEST_EDGE, REAR, WIDTH, Heap, check_heap
from unload import task
from unload.physics.bullet import FRICTION, World
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
NEAR = 0.6  # m around the drag, within which ``near`` lets boxes move
SUPPORT = 0.05  # m around those, within which it keeps boxes as obstacles
# Name → time step in s, solver iterations, whether boxes far from the drag are left out. Coarse
# takes a third of the time of whole. Near takes a seventh, but it counts fewer falls, because
# chains of boxes end where its neighbourhood does.
PHYSICS = {
    "whole": (1 / 240, 50, False),
    "coarse": (1 / 120, 20, False),
    "near": (1 / 120, 20, True),
}

# What a pick depends on besides the heap, the box and the arguments of ``Rake``.
CONSTANTS = (
    SPEED,
    FORCE,
    REACH,
    TIME,
    CAME,
    REST,
    RESTS,
    STILL,
    FALL,
    NEAR,
    SUPPORT,
    FARTHEST_EDGE,
    FRICTION,
    task.MASS,
    *PHYSICS.values(),
)


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a pick has done.

    Attributes:
        heap: what is left.
        left: (m,) int64, the numbers that its boxes had before.
        unloaded: (n,) bool, of the boxes before.
        fallen: (n,) bool, others than the dragged one that dropped by more than ``FALL``,
            whether they were unloaded or not.
        moved: m, how far the dragged box came along x.
        came: whether that was at least ``CAME``.
    """

    heap: Heap
    left: np.ndarray
    unloaded: np.ndarray
    fallen: np.ndarray
    moved: float
    came: bool


def add_walls(world: World, friction: float = FRICTION) -> None:
    """Add floor, rear wall and both side walls, each 1 m thick and reaching beyond the door."""
    middle = (REAR + DOOR) / 2
    for position, size in (
        ((middle, WIDTH / 2, -0.5), (40, 40, 1)),
        ((REAR - 0.5, WIDTH / 2, 5), (1, WIDTH + 2, 10)),
        ((middle, -0.5, 5), (12, 1, 10)),
        ((middle, WIDTH + 0.5, 5), (12, 1, 10)),
    ):
        world.add_box(position, size, 0, friction=friction)


def drag(world: World, body: int, mass: float) -> float:
    """Drag a body towards the door by its centre of mass, and stop it in that direction.

    A controller holds ``SPEED``, as far as ``FORCE`` allows, until the body has moved by
    ``REACH`` or ``TIME`` is over.

    Args:
        world: which holds it.
        body: its number there.
        mass: of it, kg.

    Returns:
        How far it came along x, in m.
    """
    start = world.pose(body)[0][0]
    for _ in range(round(TIME / world.time_step)):
        if world.pose(body)[0][0] - start >= REACH:
            break
        # What would bring the body to its speed within this step, if nothing resisted.
        wanted = mass * (SPEED - world.velocity(body)[0]) / world.time_step
        world.push(body, (min(max(wanted, -FORCE), FORCE), 0, 0))
    moved = world.pose(body)[0][0] - start
    world.stop(body)
    return moved


def near_boxes(heap: Heap, box: int) -> tuple[np.ndarray, np.ndarray]:
    """Boxes that may move when ``box`` is dragged, and their fixed neighbours, by distance.

    Returns:
        Two (n,) bool: less than ``NEAR`` from the block that the dragged box passes through,
        and of the others those within ``SUPPORT`` of one of these.
    """
    half = heap.extents() / 2
    low, high = heap.positions - half, heap.positions + half
    reach = high[box] + (REACH, 0, 0)
    gap = np.maximum(np.maximum(low - reach, low[box] - high), 0)
    moving = (gap**2).sum(axis=1) < NEAR**2
    touching = (low[:, None] < high[moving] + SUPPORT) & (high[:, None] > low[moving] - SUPPORT)
    return moving, touching.all(axis=2).any(axis=1) & ~moving


class Rake:
    """Picks boxes of heaps in one PyBullet client.

    A pick drags a box towards the door: ``SPEED``, at most ``FORCE``, until it has moved by
    ``REACH`` or ``TIME`` is over. After ``REST``, the boxes whose centre is beyond the edge of
    the conveyor are unloaded, and so is the dragged box, if it came. The edge stands where the
    foremost face of the heap was before the pick, at most 0.2 m outside the door
    (``Heap.edge``); at the foremost centre, boxes that creep by millimetres would count. Since
    unloading takes supports away, and boxes may still be toppling, this is repeated until
    nothing is unloaded and nothing is faster than ``STILL``, at most ``RESTS`` times, so that
    what falls counts for the pick that has caused it. Of 160 random picks 14 % used up all
    rests; what still moves then stands where it is, at rest, when the next pick begins.

    Every pick builds the world anew from the heap, so that it depends on nothing else, to the
    bit: not on earlier picks, of which PyBullet would remember contacts.

    Args:
        physics: ``"whole"``, all boxes at PyBullet's default of 240 Hz and 50 iterations of
            the solver; ``"coarse"``, all boxes at 120 Hz and 20 iterations; ``"near"``, as
            coarse, but only boxes near the drag can move.
        friction: of boxes, floor and walls; Bullet multiplies the two of a contact.
        mass: kg, of each box.

    Raises:
        TypeError, ValueError: an argument is not as described.
    """

    def __init__(
        self, physics: str = "whole", friction: float = FRICTION, mass: float = task.MASS
    ) -> None:
        checks.one_of("physics", physics, PHYSICS)
        self.physics = physics
        self.friction = checks.real("friction", friction, 0, 10)
        self.mass = checks.real("mass", mass, 0.01, 1000)
        time_step, iterations, self._near = PHYSICS[physics]
        self._world = World(time_step, iterations=iterations)

    def pick(self, heap: Heap, box: int) -> Outcome:
        """Drag one box and see what comes.

        Raises:
            TypeError, ValueError: ``heap`` is as ``check_heap`` refuses it, or ``box`` none of
                its boxes.
        """
        box = self._check(heap, box)
        world, edge = self._world, heap.edge()
        bodies = self._build(heap, box)
        moved = drag(world, bodies[box], self.mass)
        came = moved >= CAME
        unloaded = np.zeros(len(heap), bool)
        last = Poses(heap)
        for _ in range(RESTS):
            world.step(REST)
            last.read(world, bodies)
            gone = last.positions[:, 0] > edge
            gone[box] |= came
            gone &= ~unloaded
            speeds = [np.linalg.norm(world.velocity(body)) for body in bodies.values()]
            if not gone.any() and max(speeds, default=0) < STILL:
                break
            unloaded |= gone
            for number in np.flatnonzero(gone).tolist():
                world.remove(bodies.pop(number))
        fallen = heap.positions[:, 2] - last.positions[:, 2] > FALL
        fallen[box] = False
        left = np.flatnonzero(~unloaded)
        after = Heap(last.positions, last.orientations, heap.sizes, heap.packages).only(left)
        return Outcome(after, left, unloaded, fallen, float(moved), bool(came))

    def _check(self, heap: Heap, box: int) -> int:
        """The box as an int, if both are as ``pick`` expects them."""
        check_heap("heap", heap)
        return checks.integer("box", box, 0, len(heap) - 1)

    def _build(self, heap: Heap, box: int) -> dict[int, int]:
        """Fill the world; return the bodies of the boxes that can move, by box number."""
        self._world.clear()
        add_walls(self._world, self.friction)
        moving, fixed = np.ones(len(heap), bool), np.zeros(len(heap), bool)
        if self._near:
            moving, fixed = near_boxes(heap, box)
        bodies = {}
        for number in np.flatnonzero(moving | fixed).tolist():
            body = self._world.add_box(
                heap.positions[number],
                heap.sizes[number],
                self.mass if moving[number] else 0,
                heap.orientations[number],
                self.friction,
            )
            if moving[number]:
                bodies[number] = body
        return bodies

    def close(self) -> None:
        """Disconnect the client; may be called again."""
        self._world.close()


class Poses:
    """Where the boxes of a heap were last seen."""

    def __init__(self, heap: Heap) -> None:
        self.positions, self.orientations = heap.positions.copy(), heap.orientations.copy()

    def read(self, world: World, bodies: dict[int, int]) -> None:
        for number, body in bodies.items():
            self.positions[number], self.orientations[number] = world.pose(body)
