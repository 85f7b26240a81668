"""The drift of settled boxes, drawn from simulated columns."""

import gymnasium
import numpy as np
import pytest

from tests.env.comparing import CONTAINER, assert_same
from unload.env.settled import columns_of, read_settled, settled_drift, shared_settled
from unload.load.contacts import ABOVE
from unload.load.substacks import build_load
from unload.support import files


def test_columns_are_the_substacks_of_a_load(rng):
    variants = rng.integers(3, size=(5, 3, 4))
    load = build_load(variants)
    kinds, columns, numbers = columns_of(load)
    np.testing.assert_array_equal(kinds, 9 * variants[:, 0] + 3 * variants[:, 1] + variants[:, 2])
    for column in range(20):
        boxes = np.flatnonzero(columns == column)
        assert set(load.walls[boxes].tolist()) == {column // 4}
        assert numbers[boxes].tolist() == list(range(len(boxes)))
        middle = load.positions[boxes, 1].mean() / 2.5
        assert middle == pytest.approx([1 / 9, 11 / 36, 21 / 36, 31 / 36][column % 4], abs=0.09)


def test_drift_is_that_of_simulated_columns_of_the_same_kind(rng, full_load):
    settled = shared_settled()
    offsets = settled_drift(full_load, rng, settled)
    assert offsets.shape == (len(full_load), 4)
    kinds, columns, _ = columns_of(full_load)
    found = set()
    for column, kind in enumerate(kinds.reshape(-1)):
        starts = settled.starts[column % 4, kind]
        samples = [settled.offsets[first:last] for first, last in zip(starts, starts[1:])]
        mine = offsets[columns == column]
        found.add(next(i for i, each in enumerate(samples) if np.array_equal(each, mine)))
    assert len(found) == settled.starts.shape[2] - 1  # each sample is drawn
    again = settled_drift(full_load, np.random.default_rng(1), settled)
    same = settled_drift(full_load, np.random.default_rng(1), settled)
    assert np.array_equal(again, same) and not np.array_equal(again, offsets)


def test_boxes_sink_by_about_a_millimetre_and_less_with_nothing_on_them(full_load):
    offsets = settled_drift(full_load, np.random.default_rng(0), shared_settled())
    assert -1.5e-3 < offsets[:, 2].mean() < -0.5e-3
    assert (offsets[:, 3] >= offsets[:, 2] - 5e-4).mean() > 0.95
    bare = [not len(full_load.contacts.of(ABOVE, box)) for box in range(len(full_load))]
    assert offsets[bare, 3] == pytest.approx(offsets[bare, 2])
    assert np.abs(offsets).max() < 0.02


def test_a_settled_state_goes_on_identically(rng):
    one, other = (
        gymnasium.make_vec(CONTAINER, 3, drift="settled", max_picks=40).unwrapped for _ in range(2)
    )
    one.reset(seed=0)
    for _ in range(55):
        one.step(rng.integers(128, size=3))
    other.set_state(one.get_state())
    for _ in range(45):
        actions = rng.integers(128, size=3)
        assert_same(one.step(actions), other.step(actions))


def test_other_loads_do_not_settle(few_items):
    envs = gymnasium.make_vec(CONTAINER, 1, drift="settled", stack=lambda rng: few_items(rng, 50))
    with pytest.raises(ValueError, match="expected a load of the paper's substacks"):
        envs.reset(seed=0)
    with pytest.raises(ValueError, match="drift is 'wind'; expected one of 'noise', 'settled'"):
        gymnasium.make_vec(CONTAINER, 1, drift="wind")


def test_missing_or_damaged_columns_are_named(tmp_path):
    path = tmp_path / "settled.npz"
    with pytest.raises(FileNotFoundError, match="settled.npz is missing; python -m"):
        read_settled(path)
    files.write_arrays(path, {"counts": np.ones((4, 27, 2), int)})
    with pytest.raises(ValueError, match="settled.npz has no offsets"):
        read_settled(path)
    files.write_arrays(path, {"counts": np.ones((4, 27, 2), int), "offsets": np.zeros((3, 4), int)})
    with pytest.raises(ValueError, match=r"settled.npz: offsets has shape \(3, 4\)"):
        read_settled(path)
