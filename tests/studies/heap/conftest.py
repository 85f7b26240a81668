"""Small heaps that are made at once: towers of upright cubes, and a pile."""

from collections.abc import Callable

import numpy as np
import pytest

from studies.heap.boxes import Heap
from studies.heap.env import HeapEnv
from unload.physics.bullet import World

EDGE = 0.4  # m


@pytest.fixture(scope="session")
def cubes() -> Callable[..., Heap]:
    """``cubes((x, y, level), ...)``: upright cubes of 0.4 m, level 0 on the floor."""

    def build(*places: tuple[float, float, int]) -> Heap:
        positions = np.array([(x, y, EDGE * (level + 0.5)) for x, y, level in places])
        count = len(places)
        turns = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
        return Heap(positions, turns, np.full((count, 3), EDGE), np.zeros(count, int))

    return build


@pytest.fixture(scope="session")
def pile(cubes) -> Heap:
    """Nine cubes in three rows and two levels, a few of them turned: a small heap."""
    heap = cubes(
        *((x, y, 0) for x in (4.5, 5.0) for y in (0.5, 1.0, 1.5)),
        *((4.75, y, 1) for y in (0.5, 1.0, 1.5)),
    )
    turns = heap.orientations.copy()
    turns[6:] = (0, 0, np.sin(0.2), np.cos(0.2))
    return Heap(heap.positions, turns, heap.sizes, heap.packages)


@pytest.fixture
def set_friction(monkeypatch) -> Callable[[float], None]:
    """``set_friction(value)``: of boxes, floor and walls, 0.5 if it is not called."""

    def change(value: float) -> None:
        add_box = World.add_box
        monkeypatch.setattr(World, "add_box", lambda *given: add_box(*given, friction=value))

    return change


@pytest.fixture
def make_heap_env(pile, monkeypatch) -> Callable[..., HeapEnv]:
    """``make_heap_env(*heaps, ...)``: an environment of the small pile or others."""

    def make(*heaps: Heap, **settings) -> HeapEnv:
        monkeypatch.setattr("studies.heap.env.stored_heaps", lambda split: heaps or (pile,))
        return HeapEnv(**({"physics": "coarse"} | settings))

    return make
