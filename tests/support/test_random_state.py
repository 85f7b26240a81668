"""Generators' states as text."""

import numpy as np
import pytest

from unload.support.random_state import check_text, set_text, to_text


def test_a_generator_goes_on_from_its_text(rng):
    rng.random(3)
    text = np.array(to_text(rng))
    wanted = rng.random(5)
    other = np.random.default_rng(7)
    check_text("rng", text)
    set_text(text, other)
    assert other.random(5).tolist() == wanted.tolist()


@pytest.mark.parametrize("text", ["", "dice", "{}", 3, '{"bit_generator": "MT19937"}'])
def test_other_text_is_refused(text):
    with pytest.raises(ValueError, match="start is .*; expected a generator's state"):
        check_text("start", text)
