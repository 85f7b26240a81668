"""The figures of lifts. What ``agreement_scatter`` shows is tested with its data."""

import numpy as np
import pytest

from unload.reproduce.figures.lifting import lift_sequences


def test_bad_lift_sequences_are_refused():
    sizes, poses = np.ones((2, 2)), np.zeros((1, 2, 3))
    for lifts, times, error, message in (
        ({}, [0.0], ValueError, "lifts has 0 and times 1 entries; expected at least one"),
        ({"a": (sizes, poses)}, [], ValueError, "lifts has 1 and times 0 entries"),
        ([1], [0.0], TypeError, r"lifts is \[1\]; expected a dict"),
        ({"a": (sizes, poses)}, [0.0, 0.1], ValueError, "poses of 'a' has shape"),
    ):
        with pytest.raises(error, match=message):
            lift_sequences(lifts, times)
    assert len(lift_sequences({"a": (sizes, poses)}, [0.0]).axes) == 1
