from itertools import combinations

import numpy as np
import pytest

from unload.load.colours import COLOURS, css

# Machado et al. (2009): linear RGB as seen without the long, the middle, the short cones.
BLINDNESS = {
    "protanopia": [[0.152, 1.053, -0.205], [0.115, 0.786, 0.099], [-0.004, -0.048, 1.052]],
    "deuteranopia": [[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]],
    "tritanopia": [[1.256, -0.077, -0.179], [-0.078, 0.931, 0.148], [0.005, 0.691, 0.304]],
}


@pytest.mark.parametrize("kind", BLINDNESS)
def test_the_colour_blind_tell_all_meanings_apart(kind):
    linear = np.array(list(COLOURS.values())) ** 2.2
    seen = (linear @ np.transpose(BLINDNESS[kind])).clip(0, 1) ** (1 / 2.2)
    for (one, a), (other, b) in combinations(zip(COLOURS, seen), 2):
        assert np.linalg.norm(a - b) > 0.1, (one, other)


def test_css():
    assert css((1.0, 0.5, 0.0)) == "rgb(255,128,0)"
