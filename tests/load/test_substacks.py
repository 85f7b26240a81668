import itertools

import numpy as np
import pytest

from unload import task
from unload.load.boxes import Load
from unload.load.substacks import (
    CELL,
    CELLS_HIGH,
    CELLS_WIDE,
    PACKAGES,
    build_load,
    stack_load,
)


def wall_cells(load: Load) -> list[tuple[int, int, int]]:
    """Package, and left and lower edge in cells, of the items of a load."""
    low = np.rint((load.positions - load.sizes / 2)[:, 1:] / CELL).astype(int)
    return [*zip(load.packages.tolist(), *low.T.tolist())]


@pytest.mark.parametrize("variants", list(itertools.product(range(3), repeat=4)))
def test_every_combination_tiles_a_row(variants):
    covered, load = np.zeros((CELLS_HIGH, CELLS_WIDE), dtype=int), build_load([[variants]])
    assert (load.sizes[:, 0] == task.CONTAINER[0]).all(), "a wall alone fills the container"
    for package, left, lower in wall_cells(load):
        width, height = PACKAGES[package]
        assert left + width <= CELLS_WIDE and lower + height <= CELLS_HIGH
        covered[lower : lower + height, left : left + width] += 1
    assert (covered == 1).all()


def test_all_variants_of_all_substacks_occur(full_load):
    items = {(package, left, low % CELLS_HIGH) for package, left, low in wall_cells(full_load)}
    same_everywhere = (wall_cells(build_load([[[variant] * 4]])) for variant in range(3))
    assert items == {item for items in same_everywhere for item in items}


def test_a_load_keeps_the_papers_range(rng):
    counts = [len(stack_load(rng)) for _ in range(30)]
    assert min(counts) >= 800 and max(counts) <= 1000 and len(set(counts)) > 10


@pytest.mark.parametrize("bound", ["MIN_ITEMS", "MAX_ITEMS"])
def test_a_load_of_exactly_as_many_items_as_allowed_is_kept(monkeypatch, bound):
    first = stack_load(np.random.default_rng(5))
    monkeypatch.setattr(task, bound, len(first))
    again = stack_load(np.random.default_rng(5))
    assert again.positions.tobytes() == first.positions.tobytes()
    monkeypatch.setattr(task, bound, len(first) + (1 if bound == "MIN_ITEMS" else -1))
    assert len(stack_load(np.random.default_rng(5))) != len(first)


BAD_INPUT = {
    r"expected \(any, any, 4\)": lambda rng: build_load(np.zeros((1, 3, 3), int)),
    r"shape \(0, 3, 4\); expected a wall": lambda rng: build_load(np.zeros((0, 3, 4), int)),
    "variants holds 3 to 3; expected 0 to 2": lambda rng: build_load(np.full((1, 3, 4), 3)),
    "inside the container": lambda rng: build_load(np.zeros((1, 4, 4), int)),
    "rng is 0; expected a numpy.random.Generator": lambda rng: stack_load(0),
    "walls is 0": lambda rng: stack_load(rng, walls=0),
}


@pytest.mark.parametrize("message", BAD_INPUT)
def test_bad_input_is_refused(rng, message):
    with pytest.raises((TypeError, ValueError), match=message):
        BAD_INPUT[message](rng)
