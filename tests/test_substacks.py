import itertools

import numpy as np
import pytest

from unload import task
from unload.substacks import (
    CELL,
    CELLS_WIDE,
    COLUMNS,
    DEPTH,
    PACKAGES,
    ROWS,
    ROWS_HIGH,
    WALLS,
    Load,
    build_load,
    stack_load,
    wall_cells,
)

FIELDS = ("positions", "sizes", "packages", "walls")


def one_box(**changes) -> Load:
    """A load of one valid box, with some fields replaced."""
    fields = {
        "positions": np.array([[3.5, 1.25, 0.5]]),
        "sizes": np.ones((1, 3)),
        "packages": np.array([0]),
        "walls": np.array([0]),
    }
    return Load(**(fields | changes))


@pytest.mark.parametrize("variants", list(itertools.product(range(3), repeat=4)))
def test_every_combination_tiles_a_row(variants):
    covered = np.zeros((ROWS_HIGH, CELLS_WIDE), dtype=int)
    for package, left, lower in wall_cells([variants]):
        width, height = PACKAGES[package]
        assert left + width <= CELLS_WIDE and lower + height <= ROWS_HIGH
        covered[lower : lower + height, left : left + width] += 1
    assert (covered == 1).all()


def test_the_thirteen_packages_of_fig_3_differ():
    assert PACKAGES.shape == (13, 2)
    assert len({tuple(package) for package in PACKAGES.tolist()}) == 13


def test_all_packages_occur(rng):
    for _ in range(5):
        assert set(stack_load(rng).packages.tolist()) == set(range(13))


def test_all_variants_of_all_substacks_occur(full_load):
    low = full_load.positions - full_load.sizes / 2
    cells = np.column_stack([full_load.packages, full_load.walls, np.rint(low[:, 1:] / CELL)])
    items = {tuple(item) for item in cells.astype(int).tolist()}  # package, wall, left, lower
    for column_left, substacks in COLUMNS:
        seen = [
            number
            for number, variant in enumerate(substacks)
            for wall, row in itertools.product(range(WALLS), range(ROWS))
            if all(
                (package, wall, column_left + left, row * ROWS_HIGH + lower) in items
                for package, left, lower in variant
            )
        ]
        assert set(seen) == {0, 1, 2}
        assert len(seen) == WALLS * ROWS  # each place holds exactly one variant


def test_a_load_keeps_the_papers_range_and_the_container(rng):
    counts = []
    for _ in range(30):
        load = stack_load(rng)
        counts.append(len(load))
        assert (load.positions - load.sizes / 2 >= -1e-9).all()
        assert (load.positions + load.sizes / 2 <= task.CONTAINER + 1e-9).all()
        volume = load.sizes.prod(axis=1).sum()
        assert volume == pytest.approx(7.0 * 2.5 * 3 * ROWS_HIGH * CELL)
        assert set(load.walls.tolist()) == set(range(WALLS))
        assert (load.sizes[:, 0] == DEPTH).all()
    assert min(counts) >= 800 and max(counts) <= 1000 and len(set(counts)) > 10


def test_variants_are_drawn_anew_until_the_count_fits():
    low = build_load(np.full((WALLS, ROWS, 4), 2))
    high = build_load(np.full((WALLS, ROWS, 4), 0))
    assert len(low) < 800 and len(high) > 1000  # such draws exist and must be refused


def test_the_same_seed_gives_the_same_load_byte_for_byte():
    first, second, other = (stack_load(np.random.default_rng(seed)) for seed in (5, 5, 6))
    for name in FIELDS:
        assert getattr(first, name).tobytes() == getattr(second, name).tobytes()
    assert first.positions.tobytes() != other.positions.tobytes()


def test_build_load_places_the_walls_from_the_rear():
    load = build_load(np.zeros((2, 3, 4), dtype=int))
    assert np.unique(load.positions[:, 0]).tolist() == [1.75, 5.25]
    assert (load.positions[load.walls == 1, 0] == 5.25).all()
    assert load.positions[:, 2].max() < 3 * ROWS_HIGH * CELL


def test_a_load_cannot_be_changed(full_load):
    for name in FIELDS:
        with pytest.raises(ValueError, match="read-only"):
            getattr(full_load, name)[0] = 0


def test_a_load_does_not_change_with_the_arrays_it_was_made_from():
    positions = np.array([[3.5, 1.25, 0.5]])
    load = one_box(positions=positions)
    positions[:] = 0
    assert load.positions.tolist() == [[3.5, 1.25, 0.5]]


def test_loads_are_compared_by_identity():
    first, second = one_box(), one_box()
    assert first == first and first != second and len({first, second}) == 2


def test_touching_boxes_are_accepted(boxes):
    assert len(boxes((1.0, 0.2), (1.4, 0.2), (1.2, 0.6))) == 3


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"positions": np.zeros((0, 3))}, ValueError, "positions is empty"),
        ({"positions": np.zeros((1, 2))}, ValueError, r"positions has shape \(1, 2\)"),
        ({"positions": [[1], [1, 2]]}, ValueError, "positions has rows of different lengths"),
        ({"positions": [[np.nan, 1, 1]]}, ValueError, "positions holds nan"),
        ({"positions": [["a", "b", "c"]]}, TypeError, "positions has dtype"),
        ({"positions": [[6.6, 1.25, 0.5]]}, ValueError, "box 0 reaches from"),
        ({"positions": [[3.5, 1.25, 0.4]]}, ValueError, "box 0 reaches from"),
        ({"positions": [[3.5, 1.25, 2.1]]}, ValueError, "inside the container"),
        ({"sizes": np.ones((2, 3))}, ValueError, r"sizes has shape \(2, 3\); expected \(1, 3\)"),
        ({"sizes": [[1, 0, 1]]}, ValueError, "sizes of box 0 are"),
        ({"sizes": [[1, -1, 1]]}, ValueError, "expected all > 0"),
        ({"sizes": [[1, np.inf, 1]]}, ValueError, "sizes holds inf"),
        ({"packages": [0.0]}, TypeError, "packages has dtype float64; expected integers"),
        ({"packages": [True]}, TypeError, "packages has dtype bool"),
        ({"packages": [0, 1]}, ValueError, r"packages has shape \(2,\)"),
        ({"packages": [-1]}, ValueError, "packages holds -1"),
        ({"walls": [[0]]}, ValueError, r"walls has shape \(1, 1\)"),
        ({"walls": ["0"]}, TypeError, "walls has dtype"),
    ],
)
def test_bad_loads_are_refused(changes, error, message):
    with pytest.raises(error, match=message):
        one_box(**changes)


@pytest.mark.parametrize(
    "step", [(0.3, 0, 0), (0, 0.3, 0), (0, 0, 0.3), (0.3, 0.3, 0.3), (0, 0, 0)]
)
def test_overlapping_boxes_are_refused(step):
    positions = np.array([[1.0, 0.5, 0.5], [3.0, 1.0, 0.5], [3.0, 1.0, 0.5] + np.array(step)])
    labels = np.zeros(3, dtype=int)
    with pytest.raises(ValueError, match="boxes 1 and 2 overlap"):
        Load(positions, np.full((3, 3), 0.4), labels, labels)


@pytest.mark.parametrize(
    ("variants", "error", "message"),
    [
        (np.zeros((3, 4), dtype=int), ValueError, r"shape \(3, 4\); expected \(any, any, 4\)"),
        (np.zeros((0, 3, 4), dtype=int), ValueError, "variants has no walls"),
        (np.zeros((12, 0, 4), dtype=int), ValueError, "variants has no rows"),
        (np.zeros((1, 3, 5), dtype=int), ValueError, r"expected \(any, any, 4\)"),
        ([[[0, 0, 0, 0], [0]]], ValueError, "variants has rows of different lengths"),
        (np.zeros((1, 3, 4)), TypeError, "dtype float64; expected integers"),
        (np.full((1, 3, 4), 3), ValueError, "variants holds 3 to 3; expected 0 to 2"),
        (np.full((1, 3, 4), -1), ValueError, "variants holds -1 to -1; expected 0 to 2"),
    ],
)
def test_bad_variants_are_refused(variants, error, message):
    with pytest.raises(error, match=message):
        build_load(variants)


def test_bad_arguments_of_stack_load_are_refused(rng):
    with pytest.raises(TypeError, match="rng is 0; expected a numpy.random.Generator"):
        stack_load(0)
    with pytest.raises(ValueError, match="walls is 0"):
        stack_load(rng, walls=0)
