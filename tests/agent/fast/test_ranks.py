import numpy as np
import pytest

from unload import equalize
from unload.agent.fast import ranks
from unload.agent.fast.kernel import level
from unload.env.fast.ranking import LEVELS


@pytest.mark.parametrize("ties", ["noise", "average"])
def test_equalized_observations_come_back_to_the_bit(rng, ties):
    seen = equalize(rng.integers(-20, 20, (50, 128, 3)) / 20, ties)
    codes = ranks.encode(seen)
    assert codes.dtype == np.uint8 and codes.nbytes == seen.nbytes // 4
    back = ranks.decode(codes)
    assert back.dtype == np.float32 and back.tobytes() == seen.tobytes()


def test_each_byte_means_the_same_everywhere():
    codes = np.arange(255, dtype=np.uint8)
    levels = np.array([level(np.float32(code)) for code in codes], np.float32)
    assert levels.tobytes() == ranks.decode(codes).tobytes() == LEVELS[128, :255].tobytes()
    assert (ranks.encode(levels) == codes).all()


@pytest.mark.parametrize("value", [0.5, 1.5, -3.0, 1e30, np.nan, np.inf, np.float32(1) / 126])
def test_other_numbers_are_refused(value):
    seen = ranks.decode(np.full((2, 128, 3), 7, np.uint8))
    seen[1, 5, 2] = value
    with pytest.raises(ValueError, match="^observations holds .*expected equalized coordinates"):
        ranks.encode(seen)
