import numpy as np
import pytest

from unload.agent.replay import ReplayBuffer


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


def sample(replay: ReplayBuffer, count: int, rng: np.random.Generator) -> dict:
    rows = replay.sample_rows(count, rng)
    return {name: array[rows] for name, array in replay.arrays.items()}


@pytest.mark.parametrize("next_state", [False, True])
def test_samples_are_whole_picks(rng, next_state):
    replay = ReplayBuffer(100, 4, next_state)
    replay.add(**picks(0, 40, next_state=next_state))
    samples = sample(replay, 500, rng)
    numbers = samples["observations"][:, 0, 0].astype(int)
    assert set(numbers.tolist()) == set(range(40))
    everything = picks(0, 40, next_state=next_state)
    assert samples.keys() == everything.keys()
    for name, values in samples.items():
        np.testing.assert_array_equal(values, everything[name][numbers])


def test_the_oldest_picks_are_overwritten(rng):
    replay = ReplayBuffer(11, 4)
    for first in range(0, 24, 6):
        replay.add(**picks(first, 6))
    assert len(replay) == 11 and replay.total == 24
    kept = sample(replay, 300, rng)["observations"][:, 0, 0]
    assert set(kept.tolist()) == set(range(13, 24))
