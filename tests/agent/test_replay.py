import numpy as np
import pytest

from tests.agent.runs import make_batch, without_next
from unload.agent.replay import ReplayBuffer


@pytest.mark.parametrize("next_state", [False, True])
def test_picks_are_kept_as_they_were_added(rng, next_state):
    replay, batch = ReplayBuffer(100, 4, next_state), make_batch(rng, 40, 4)
    batch = batch if next_state else without_next(batch)
    replay.add(**batch)
    assert len(replay) == 40 and replay.arrays.keys() == batch.keys()
    for name, array in replay.arrays.items():
        assert array[:40].tobytes() == batch[name].tobytes()


def test_the_oldest_picks_are_overwritten(rng):
    replay, batch = ReplayBuffer(11, 4), without_next(make_batch(rng, 24, 4))
    for first in range(0, 24, 6):
        replay.add(**{name: array[first : first + 6] for name, array in batch.items()})
    assert len(replay) == 11 and replay.total == 24
    for name, array in replay.arrays.items():
        assert array[np.arange(13, 24) % 11].tobytes() == batch[name][13:].tobytes()
