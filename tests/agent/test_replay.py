import numpy as np
import pytest

import unload
from unload.agent.replay import ReplayBuffer, shuffle_places


def picks(first: int, count: int, items: int = 4, next_state: bool = False) -> dict:
    """Picks that can be told apart: pick k has observation k, action k % items."""
    number = np.arange(first, first + count)
    observations = np.ones((count, items, 3), np.float32) * number[:, None, None]
    batch = {
        "observations": observations,
        "actions": number % items,
        "rewards": np.where(number % 2, 1.0, -1.0),
    }
    if next_state:
        batch |= {
            "next_observations": observations + 0.5,
            "next_masks": np.arange(items) != (number % items)[:, None],
            "terminations": number % 3 == 0,
        }
    return batch


@pytest.mark.parametrize("next_state", [False, True])
def test_samples_are_whole_picks(rng, next_state):
    replay = ReplayBuffer(100, 4, next_state)
    replay.add(**picks(0, 40, next_state=next_state))
    sample = replay.sample(500, rng)
    numbers = sample["observations"][:, 0, 0].astype(int)
    assert set(numbers.tolist()) == set(range(40))
    assert sample.keys() == replay.arrays.keys()
    everything = picks(0, 40, next_state=next_state)
    for name, values in sample.items():
        assert len(values) == 500
        np.testing.assert_array_equal(values, everything[name][numbers])


def test_the_oldest_picks_are_overwritten(rng):
    replay = ReplayBuffer(10, 4)
    for first in range(0, 24, 6):
        replay.add(**picks(first, 6))
    assert len(replay) == 10 and replay.total == 24
    kept = replay.sample(300, rng)["observations"][:, 0, 0]
    assert set(kept.tolist()) == set(range(14, 24))


def test_samples_are_uniform_and_seeded(rng):
    replay = ReplayBuffer(8, 4)
    replay.add(**picks(0, 8))
    counts = np.bincount(replay.sample(40_000, rng)["observations"][:, 0, 0].astype(int))
    assert counts / 40_000 == pytest.approx(np.full(8, 1 / 8), abs=0.01)
    first, same = (replay.sample(50, np.random.default_rng(1))["rewards"] for _ in range(2))
    assert (first == same).all()


def test_sampling_refuses(rng):
    replay = ReplayBuffer(10, 4)
    with pytest.raises(ValueError, match="the replay buffer is empty"):
        replay.sample(1, rng)
    replay.add(**picks(0, 2))
    with pytest.raises(ValueError, match="batch_size is 0"):
        replay.sample(0, rng)
    with pytest.raises(TypeError, match="rng is None; expected a numpy.random.Generator"):
        replay.sample(1, None)


@pytest.mark.parametrize(("size", "items", "name"), [(0, 4, "size"), (4, 0, "items")])
def test_bad_sizes_are_refused(size, items, name):
    with pytest.raises(ValueError, match=f"{name} is 0"):
        ReplayBuffer(size, items)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rewards": np.array([1e39, 1.0])}, "rewards holds inf"),
        ({"rewards": np.array([np.inf, 1.0], np.float32)}, "rewards holds inf"),
        ({"observations": np.full((2, 5, 3), np.nan, np.float32)}, "observations holds nan"),
        ({"next_observations": np.full((2, 5, 3), -np.inf, np.float32)}, "next_.* holds -inf"),
        ({"actions": np.array([0, 5])}, "actions holds 0 to 5; expected 0 to 4"),
        ({"actions": np.array([-1, 0])}, "actions holds -1 to 0; expected 0 to 4"),
        ({"next_masks": np.zeros((2, 5), bool)}, "next_masks is all zero in row 0"),
        ({"next_masks": np.full((2, 5), 2)}, "next_masks holds 2"),
        ({"masks": np.ones(2)}, "batch has .*expected"),
        ({"actions": np.zeros(3, int)}, r"actions has shape \(3,\); expected \(2,\)"),
        ({"actions": np.zeros(2)}, "actions has dtype float64; expected integers"),
        ({"observations": np.zeros((2, 4, 3))}, r"observations has shape \(2, 4, 3\)"),
        ({"rewards": 1.0}, r"rewards has shape \(\)"),
    ],
)
def test_what_would_spoil_learning_is_refused_where_it_enters(rng, change, message):
    replay = ReplayBuffer(10, 5, next_state=True)
    batch = {
        "observations": rng.uniform(-1, 1, (2, 5, 3)),
        "actions": np.array([0, 4]),
        "rewards": np.array([1.0, -1.0]),
        "next_observations": rng.uniform(-1, 1, (2, 5, 3)),
        "next_masks": np.ones((2, 5), bool),
        "terminations": np.array([False, False]),
    }
    with pytest.raises((TypeError, ValueError), match=message):
        replay.add(**batch | change)
    assert len(replay) == 0
    replay.add(**batch)
    assert len(replay) == 2


def equalized_picks(rng, count: int) -> dict:
    """Picks of equalized observations of 128 items."""
    return {
        "observations": unload.equalize(rng.random((count, 128, 3))),
        "actions": rng.integers(128, size=count),
        "rewards": rng.choice([-1.0, 1.0], count),
    }


def test_bytes_hold_the_same_picks_as_floats(rng):
    batch = equalized_picks(rng, 30)
    samples = []
    for equalized in (True, False):
        replay = ReplayBuffer(20, 128, equalized=equalized)
        replay.add(**{name: values[:15] for name, values in batch.items()})
        replay.add(**{name: values[15:] for name, values in batch.items()})
        samples.append(replay.sample(50, np.random.default_rng(1)))
        assert replay.arrays["observations"].itemsize == (1 if equalized else 4)
    for name, values in samples[0].items():
        assert values.dtype == samples[1][name].dtype
        np.testing.assert_array_equal(values, samples[1][name])


def test_bytes_hold_equalized_observations_only(rng):
    replay, batch = ReplayBuffer(20, 128, equalized=True), equalized_picks(rng, 3)
    batch["observations"][2, 127, 2] = 0.3
    with pytest.raises(ValueError, match="observations holds 0.3"):
        replay.add(**batch)
    assert len(replay) == 0
    for items, next_state in ((64, False), (129, False), (128, True)):
        with pytest.raises(ValueError, match="^equalized is True with items="):
            ReplayBuffer(20, items, next_state, equalized=True)


def test_places_are_shuffled_among_the_items_of_each_observation():
    rng = np.random.default_rng(0)
    seen = rng.random((5, 128, 3)).astype(np.float32)
    found = shuffle_places(seen, rng)
    assert (found[..., 2] == seen[..., 2]).all()
    assert (found[..., 0] != seen[..., 0]).mean() > 0.9
    for before, after in zip(seen[..., :2], found[..., :2]):  # x and y stay together
        assert sorted(map(tuple, before.tolist())) == sorted(map(tuple, after.tolist()))


def test_rows_without_an_item_keep_their_places():
    rng = np.random.default_rng(0)
    seen = rng.random((3, 128, 3)).astype(np.float32)
    present = np.arange(128) < np.array([[128], [50], [1]])
    found = shuffle_places(seen, rng, present)
    assert (found[~present] == seen[~present]).all()
    assert (found[1, :50, 0] != seen[1, :50, 0]).any()
    assert sorted(found[1, :50, 0]) == sorted(seen[1, :50, 0])
