"""Heaps: boxes dropped behind a barrier that is then taken away."""

from fractions import Fraction
from functools import cache
from math import sqrt
from pathlib import Path

import numpy as np

from studies import paths
from studies.heap.boxes import DOOR, REAR, WIDTH, Heap, package_sizes
from studies.heap.rake import PHYSICS, add_walls, fill
from unload import task
from unload.load.substacks import PACKAGES
from unload.physics.bullet import World
from unload.support import checks, files

BOXES = 130  # dropped; with 140, half of the heaps are higher than the container
LAYER = 10  # boxes dropped at once, one above the other
BARRIER = 6.25  # m, x of its rear face: the boxes just fit below the ceiling behind it
MARGIN = 0.4  # m between the walls and where centres are dropped
SPACING = 0.55  # m of height between boxes of a layer
LAYER_TIME = 0.7  # s between layers
SETTLE = 1.0  # s
PAUSE = 0.1  # s over which speeds are measured
ROUNDS = 8  # of settling and clearing at most, after the barrier is gone
TRIES = 20  # heaps made at most until one is accepted
FEWEST, HIGHEST, FASTEST = 80, float(task.CONTAINER[2]), 0.1  # boxes, m, m/s: see ``settled_heap``
SPLITS = "train", "test"
STORED = {"positions": np.float32, "orientations": np.float32, "packages": np.int8}


def settled_heap(rng: np.random.Generator) -> Heap:
    """A random heap at rest, about 3 s of CPU time.

    Packages and orientations are uniformly random. The drop is simulated by ``"coarse"``
    physics, what follows by ``"whole"``. Boxes whose centre is beyond the door are cleared
    away. A heap is rejected, and another one made, if it is higher than the container, holds
    fewer than 80 boxes, has a box outside the walls, or is not at rest after at most ``ROUNDS``
    rounds of settling and clearing: a box is beyond the door, or faster than 0.1 m/s in the
    last 0.1 s.

    Raises:
        RuntimeError: ``TRIES`` heaps were rejected.
    """
    for _ in range(TRIES):
        heap, fastest = _settled(_dropped(rng))
        if _accepted(heap, fastest):
            return heap
    raise RuntimeError(f"{TRIES} heaps were rejected; see settled_heap")


def _dropped(rng: np.random.Generator) -> Heap:
    """Boxes that have come to lie behind the barrier."""
    packages = rng.integers(len(PACKAGES), size=BOXES)
    sizes = package_sizes(packages)
    time_step, iterations = PHYSICS["coarse"]
    world = World(time_step, iterations=iterations)
    add_walls(world)
    world.add_box((BARRIER + 0.5, WIDTH / 2, 10), (1, WIDTH + 2, 20), 0)

    # Each layer is dropped from just above the highest box so far.
    bodies: list[int] = []
    for first in range(0, BOXES, LAYER):
        top = max((world.pose(body)[0][2] for body in bodies), default=0.0)
        for number in range(first, min(first + LAYER, BOXES)):
            turn = rng.normal(size=4)
            place = (
                rng.uniform(REAR + MARGIN, BARRIER - MARGIN),
                rng.uniform(MARGIN, WIDTH - MARGIN),
                top + SPACING * (1 + number - first),
            )
            turn /= _length(turn)
            bodies.append(world.add_box(place, sizes[number], task.MASS, turn))
        world.step(LAYER_TIME)
    world.step(SETTLE)
    positions, orientations = (np.array(part) for part in zip(*map(world.pose, bodies)))
    return Heap(positions, orientations, sizes, packages)


def _length(vector: np.ndarray) -> float:
    """The Euclidean length, with the same bits on every processor.

    ``np.linalg.norm`` leaves the rounding to BLAS, which has other kernels for other
    processors, and a falling heap magnifies the last bit.
    """
    total = 0.0
    for value in vector.tolist():
        total = float(Fraction(value) ** 2 + Fraction(total))  # one rounding for each term
    return sqrt(total)


def _settled(heap: Heap) -> tuple[Heap, float]:
    """The heap without its barrier and without what leaves the door, and its fastest box's m/s."""
    world = World()
    bodies = fill(world, heap, task.MASS)
    for _ in range(ROUNDS):
        world.step(SETTLE)
        outside = [number for number, body in bodies.items() if world.pose(body)[0][0] > DOOR]
        for number in outside:
            world.remove(bodies.pop(number))
        before = [world.pose(body)[0] for body in bodies.values()]
        world.step(PAUSE)
        poses = [world.pose(body) for body in bodies.values()]
        moved = np.array([pose[0] for pose in poses]) - before
        fastest = float(np.linalg.norm(moved, axis=1).max()) / PAUSE
        if not outside and fastest <= FASTEST:
            break
    numbers = list(bodies)
    # Rounded as they are stored, so that a heap is the same before and after.
    positions, orientations = (np.array(part, np.float32).astype(float) for part in zip(*poses))
    left = Heap(positions, orientations, heap.sizes[numbers], heap.packages[numbers])
    return left, fastest


def _accepted(heap: Heap, fastest: float) -> bool:
    top = (heap.positions[:, 2] + heap.extents()[:, 2] / 2).max()
    inside = ((heap.positions > (REAR, 0, 0)) & (heap.positions < (DOOR, WIDTH, HIGHEST))).all()
    return bool(len(heap) >= FEWEST and top <= HIGHEST and inside and fastest <= FASTEST)


def write_heaps(path: str | Path, heaps: dict[str, list[Heap]]) -> None:
    """Write heaps of each split as one ``.npz`` of plain arrays, about 4 kB a heap."""
    arrays = {}
    for split, of in heaps.items():
        arrays[f"{split}_counts"] = np.array([len(heap) for heap in of])
        for name, dtype in STORED.items():
            joined = np.concatenate([getattr(heap, name) for heap in of])
            arrays[f"{split}_{name}"] = joined.astype(dtype)
    files.write_arrays(path, arrays)


@cache
def stored_heaps(
    split: str, path: str | Path = paths.DATA / "heap" / "heaps.npz"
) -> tuple[Heap, ...]:
    """The stored heaps of a split, ``"train"`` or ``"test"``, read once."""
    checks.one_of("split", split, SPLITS)
    arrays = files.read_arrays(path)
    wanted = [f"{split}_{name}" for name in ("counts", *STORED)]
    checks.entries(str(path), arrays, wanted)
    ends = np.cumsum(arrays[f"{split}_counts"])[:-1]
    positions, orientations, packages = (
        np.split(arrays[f"{split}_{name}"], ends) for name in STORED
    )
    return tuple(
        Heap(place.astype(float), turn.astype(float), package_sizes(kind), kind.astype(int))
        for place, turn, kind in zip(positions, orientations, packages)
    )
