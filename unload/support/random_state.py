"""The state of a random generator as text, to be kept with other plain arrays."""

import json

import numpy as np


def to_text(rng: np.random.Generator) -> str:
    """The state of a generator as JSON."""
    return json.dumps(rng.bit_generator.state)


def check_text(name: str, text: object) -> None:
    """Raise ValueError unless ``text`` is a ``PCG64``'s state, as ``to_text`` writes it.

    Args:
        name: what the error calls it.
        text: str, or an array that holds one.
    """
    try:
        np.random.PCG64().state = json.loads(str(text))
    except (KeyError, OverflowError, TypeError, ValueError) as error:
        raise ValueError(f"{name} is {text!r}; expected a generator's state") from error


def set_text(text: object, rng: np.random.Generator) -> None:
    """Let ``rng`` go on from a state that ``to_text`` wrote."""
    rng.bit_generator.state = json.loads(str(text))
