"""Generators' states as text."""

import numpy as np
import pytest

from unload.support.random_state import check_text, kept_on_error, set_text, to_text


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


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_error_sets_generators_back(error):
    rngs = [np.random.default_rng(seed) for seed in (0, 1)]
    wanted = [np.random.default_rng(seed).random(3).tolist() for seed in (0, 1)]
    with pytest.raises(error), kept_on_error(rngs):
        rngs[0].random(5)
        rngs[1].standard_normal()
        raise error
    assert [rng.random(3).tolist() for rng in rngs] == wanted


def test_without_an_error_generators_go_on(rng):
    with kept_on_error([rng]):
        rng.random(5)
    assert rng.random() == np.random.default_rng(0).random(6)[5]
