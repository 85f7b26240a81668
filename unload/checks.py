"""Errors for bad input: each names the argument, its value and what was expected."""

from collections.abc import Iterable
from numbers import Integral, Real

import numpy as np


def one_of(name: str, value: object, options: Iterable[object]) -> None:
    """Raise ValueError unless ``value`` is one of ``options``."""
    options = list(options)
    if not any(value is option or value == option for option in options):
        known = ", ".join(repr(option) for option in options)
        raise ValueError(f"{name} is {value!r}; expected one of {known}")


def boolean(name: str, value: object) -> bool:
    """Return ``value`` as bool; raise TypeError unless it is True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{name} is {value!r}; expected True or False")
    return bool(value)


def integer(name: str, value: object, low: int, high: int | None = None) -> int:
    """Return ``value`` as int; raise unless it is an integer in [low, high]."""
    upper = "" if high is None else f" and <= {high}"
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, Integral):
        raise TypeError(f"{name} is {value!r}; expected an integer >= {low}{upper}")
    if value < low or (high is not None and value > high):
        raise ValueError(f"{name} is {value!r}; expected an integer >= {low}{upper}")
    return int(value)


def real(name: str, value: object, low: float, high: float = np.inf) -> float:
    """Return ``value`` as float; raise unless it is a finite number in [low, high]."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, Real):
        raise TypeError(f"{name} is {value!r}; expected a number in [{low}, {high}]")
    if not np.isfinite(value) or not low <= value <= high:
        raise ValueError(f"{name} is {value!r}; expected a finite number in [{low}, {high}]")
    return float(value)


def generator(name: str, value: object) -> np.random.Generator:
    """Return ``value``; raise TypeError unless it is a ``numpy.random.Generator``."""
    if not isinstance(value, np.random.Generator):
        raise TypeError(
            f"{name} is {value!r}; expected a numpy.random.Generator, "
            "for example numpy.random.default_rng(0)"
        )
    return value


def finite_array(name: str, value: object, shape: tuple[int | None, ...]) -> np.ndarray:
    """Return ``value`` as a float64 array; raise unless it is finite and has ``shape``.

    ``None`` in ``shape`` admits any length on that axis.
    """
    array = np.asarray(value)
    if array.dtype.kind not in "fiu":
        raise TypeError(f"{name} has dtype {array.dtype}; expected real numbers")
    fits = array.ndim == len(shape) and all(
        want is None or have == want for have, want in zip(array.shape, shape)
    )
    if not fits:
        expected = "(" + ", ".join("any" if n is None else str(n) for n in shape) + ")"
        raise ValueError(f"{name} has shape {array.shape}; expected {expected}")
    if not np.isfinite(array).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise ValueError(f"{name} holds {array[where]} at index {where}; expected finite numbers")
    return array.astype(np.float64)
