"""The state of a random generator as text, to be kept with other plain arrays."""

import json
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import numpy as np


def to_text(rng: np.random.Generator) -> str:
    """Return the state of a generator as JSON.

    Raises:
        TypeError: its bit generator is not a ``PCG64``, as those of ``default_rng`` are.
    """
    if not isinstance(rng.bit_generator, np.random.PCG64):
        raise TypeError(f"the generator is {rng!r}; expected one of numpy.random.default_rng")
    return json.dumps(rng.bit_generator.state)


def check_text(name: str, text: object) -> None:
    """Raise ValueError unless ``text`` is a ``PCG64``'s state, as ``to_text`` writes it.

    Args:
        name: what the error calls it.
        text: str, or an array that holds one.
    """
    try:
        np.random.PCG64().state = json.loads(str(text))
    except (KeyError, OverflowError, RecursionError, TypeError, ValueError) as error:
        raise ValueError(f"{name} is {text!r}; expected a generator's state") from error


def set_text(text: object, rng: np.random.Generator) -> None:
    """Let ``rng`` go on from a state that ``to_text`` wrote."""
    rng.bit_generator.state = json.loads(str(text))


@contextmanager
def kept_on_error(rngs: Iterable[np.random.Generator]) -> Iterator[None]:
    """Set generators back to their present states if the block raises an error."""
    states = [(rng.bit_generator, rng.bit_generator.state) for rng in rngs]
    try:
        yield
    except BaseException:
        for generator, state in states:
            generator.state = state
        raise
