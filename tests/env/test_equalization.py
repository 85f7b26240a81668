"""What is observed: the nearest items, scaled, and their ranks."""

import numpy as np
import pytest

from unload import equalize, task
from unload.env import observation
from unload.task import TIE_TOLERANCE


def test_table_one():
    values = np.array([0.10, 0.12, 0.11, 0.20, 0.19, 0.18, 0.30])
    # The table cuts off after two digits.
    expected = [-1, -0.33, -0.66, 0.66, 0.33, 0, 1]
    assert equalize(values[:, None])[:, 0] == pytest.approx(expected, abs=0.01)


def test_average_bridges_the_noise_and_not_a_cell_of_the_grid():
    noise, cell = 2 * 0.003 / 2.5, 2 * 0.5 * task.CONTAINER[1] / 36 / 2.5  # scaled to [-1, 1]
    values = np.array([0.1, 0.1 + noise, 0.1 + noise + cell])
    assert equalize(values[:, None], "average")[:, 0] == pytest.approx([-0.5, -0.5, 1])


def ranks_one_by_one(values: list[float], ties: str) -> list[float]:
    """Algorithm 1 for the items of one axis, as one would do it by hand."""
    last, result = len(values) - 1, [0.0] * len(values)
    order = sorted(range(len(values)), key=lambda item: (values[item], item))
    run = []
    for place, item in enumerate(order):
        run.append(item)
        ends = place == last or values[order[place + 1]] - values[item] > TIE_TOLERANCE
        if ties == "noise" or ends:
            shared = place - (len(run) - 1) / 2
            for member in run:
                result[member] = (2 * shared - last) / max(last, 1)
            run = []
    return result


@pytest.mark.parametrize("ties", ["noise", "average"])
def test_it_agrees_with_a_slow_reference(rng, ties):
    """Of few different values on one axis, so that there are ties, and chains of them."""
    for count in range(2, 30):
        positions = np.stack([rng.integers(-9, 10, count) / 400, rng.uniform(-1, 1, count)], 1)
        before, everything = positions.copy(), np.ones(count, bool)
        for present in (everything, rng.random(count) < 0.5):
            result = equalize(positions, ties, present)
            for ranked, column in zip(result[present].T, positions[present].T):
                wanted = ranks_one_by_one(column.tolist(), ties)
                assert ranked.tolist() == pytest.approx(wanted, abs=1e-7)
            assert (result[~present] == -1).all() and (positions == before).all()


@pytest.mark.parametrize(
    ("positions", "kwargs", "error", "message"),
    [
        (np.zeros((1, 3)), {}, ValueError, r"positions has shape \(1, 3\).*items >= 2"),
        ([[0, np.nan], [1, 1]], {}, ValueError, r"positions holds nan at index \(0, 1\)"),
        (np.zeros((2, 1)), {"ties": "coin"}, ValueError, "ties is 'coin'; expected one of"),
        (np.zeros((2, 1)), {"present": np.ones(3)}, ValueError, r"present has shape \(3,\)"),
    ],
)
def test_bad_input_is_refused(positions, kwargs, error, message):
    with pytest.raises(error, match=message):
        equalize(positions, **kwargs)


@pytest.mark.parametrize("ties", ["noise", "average"])
@pytest.mark.parametrize("kind", [np.float32, np.float64, int])
def test_each_observation_of_many_is_ranked_as_if_it_were_alone(rng, ties, kind):
    positions = (rng.uniform(-1, 1, (2, 3, 9, 3)).round(1) * 10).astype(kind)
    present = rng.random((2, 3, 9)) < 0.6
    result = equalize(positions, ties, present=present)
    assert result.dtype == np.float32
    for index in np.ndindex(2, 3):
        alone = equalize(positions[index], ties, present=present[index])
        assert result[index].tobytes() == alone.tobytes()


@pytest.mark.parametrize("container", [(7.0, 2.5, 2.5), (12.0, 2.0, 3.0)])
def test_distance_is_the_papers_formula_from_the_containers_own_entrance(rng, container):
    points = rng.uniform(0, container, (50, 3))
    # The square root of the squares along x, y and z with the weights 1, 0 and 4.
    expected = np.hypot(container[0] - points[:, 0], 2 * (container[2] - points[:, 2]))
    own = () if container[0] == 7 else (np.array(container),)  # the paper's is the default
    assert observation.distance(points, *own) == pytest.approx(expected)
    assert observation.nearest(points, 5, *own).tolist() == np.argsort(expected)[:5].tolist()
    assert observation.scale(np.array(container) / 4, *own).tolist() == [-0.5, -0.5, -0.5]


def test_ties_go_to_the_smaller_index():
    positions = np.tile([5.0, 1.0, 1.0], (6, 1))
    positions[:, 1] = [0.1, 2.0, 0.5, 1.0, 1.5, 0.3]  # y does not count
    positions[4, 0] = 6.0
    assert observation.nearest(positions, 4).tolist() == [4, 0, 1, 2]


def test_rows_that_hold_an_item(rng):
    seen = rng.uniform(-1, 1, (2, 3, 6, 3)).astype(np.float32)
    seen[0, 1, 4:] = -1
    seen[1, 2, :, :2] = -1  # in the corner in two of three columns
    expected = np.ones((2, 3, 6), bool)
    expected[0, 1, 4:] = False
    held = observation.holds_item(seen)
    assert held.dtype == bool and (held == expected).all()
