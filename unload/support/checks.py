"""Errors for bad input: each names the argument, its value and what was expected.

A wrong type raises TypeError, a wrong value ValueError, and a library that is not installed a
ModuleNotFoundError that says how to install it.
"""

import re
from collections.abc import Hashable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from numbers import Integral
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

# An expected shape: None on an axis admits any length, None instead of a tuple any shape.
_Shape = tuple[int | None, ...] | None
_Option = TypeVar("_Option")
_LARGEST = np.iinfo(np.int64).max
# The extra of the package that installs a library, by the library's name.
EXTRAS = {
    **dict.fromkeys(("gymnasium", "llvmlite", "numba", "safetensors", "torch", "tqdm"), "train"),
    **dict.fromkeys(("PIL", "matplotlib", "plotly"), "view"),
    "openpyxl": "excel",
}


def instance(name: str, value: object, kind: Any, expected: str) -> Any:
    """Return ``value``; raise TypeError unless it is of ``kind``, see ``isinstance``."""
    if not isinstance(value, kind):
        raise TypeError(f"{name} is {value!r}; expected {expected}")
    return value


def one_of(name: str, value: object, options: Iterable[_Option]) -> _Option:
    """Return the option that equals ``value``; raise ValueError if there is none."""
    options = list(options)
    single = isinstance(value, Hashable) and getattr(value, "shape", ()) == ()  # no array or tensor
    if not (single and value in options):
        known = ", ".join(repr(option) for option in options)
        raise ValueError(f"{name} is {value!r}; expected one of {known:.1000}")
    return options[options.index(value)]


def boolean(name: str, value: object) -> bool:
    """Return ``value`` as bool; raise TypeError unless it is True or False."""
    return bool(instance(name, value, (bool, np.bool_), "True or False"))


def integer(name: str, value: object, low: int, high: int | None = None) -> int:
    """Return ``value`` as int; raise unless it is an integer in [low, high].

    Without ``high``, the limit is that of int64, 2**63 - 1: no array holds larger ones.
    """
    wanted = f"expected an integer >= {low}" + ("" if high is None else f" and <= {high}")
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise TypeError(f"{name} is {value!r}; {wanted}")
    if not low <= int(value) <= (_LARGEST if high is None else high):
        raise ValueError(f"{name} is {value!r}; {wanted}")
    return int(value)


def path(name: str, value: object) -> Path:
    """Return ``value`` as a Path; raise TypeError unless it is one, or a str."""
    return Path(instance(name, value, (str, Path), "a path"))


def file(name: str, value: object) -> Path:
    """Return ``value`` as the Path of a file, which may be missing, but no folder or pipe."""
    named = path(name, value)
    if named.exists() and not named.is_file():  # the empty path is the working directory
        raise ValueError(f"{name} is {str(value)!r}; expected the name of a file")
    return named


def real(name: str, value: object, low: float, high: float = np.inf) -> float:
    """Return ``value`` as float; raise unless it is a finite number in [low, high].

    Numbers are those of Python and NumPy; a ``Fraction`` or ``Decimal`` is a TypeError.
    """
    numbers = (int, float, np.integer, np.floating)
    wanted = f"expected a number {f'>= {low}' if high == np.inf else f'in [{low}, {high}]'}"
    if isinstance(value, bool) or not isinstance(value, numbers):
        raise TypeError(f"{name} is {value!r}; {wanted}")
    try:
        number = float(value)
    except OverflowError:  # an integer beyond the largest float
        number = np.inf
    if not np.isfinite(number) or not low <= number <= high:
        raise ValueError(f"{name} is {value!r}; {wanted}")
    return number


def generator(name: str, value: object) -> np.random.Generator:
    """Return ``value``; raise TypeError unless it is a ``numpy.random.Generator``."""
    expected = "a numpy.random.Generator, for example numpy.random.default_rng(0)"
    return instance(name, value, np.random.Generator, expected)


def entries(name: str, value: object, required: Iterable[str]) -> None:
    """Raise unless ``value`` is a mapping that holds all ``required`` names."""
    held = instance(name, value, Mapping, "a dict")
    missing = sorted(set(required) - set(held))
    if missing:
        raise ValueError(f"{name} has no {', '.join(missing)}; expected {', '.join(required)}")


def shaped(name: str, value: Any, shape: _Shape, dtype: Any = None) -> None:
    """Check an array or tensor: raise TypeError for another dtype, ValueError for another shape."""
    if dtype is not None and getattr(value, "dtype", None) != dtype:
        given = f"a {type(value).__name__} of dtype {getattr(value, 'dtype', None)}"
        raise TypeError(f"{name} is {given}; expected {dtype}")
    has = tuple(np.shape(value))
    fits = shape is None or (
        len(has) == len(shape)
        and all(want is None or length == want for length, want in zip(has, shape))
    )
    if not fits:
        wanted = str(shape).replace("None", "any")
        raise ValueError(f"{name} has shape {has}; expected {wanted}")


def finite_array(name: str, value: object, shape: _Shape) -> np.ndarray:
    """Return ``value`` as a float64 array; raise unless it is finite and has ``shape``."""
    array = _array(name, value, shape, "fiu", "real numbers")
    array = array.astype(np.float64)
    if not np.isfinite(array).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise ValueError(f"{name} holds {array[where]} at index {where}; expected finite numbers")
    return array


def integer_array(name: str, value: object, shape: _Shape, high: int | None = None) -> np.ndarray:
    """Return ``value`` as an int64 array; raise unless it holds integers and has ``shape``.

    If ``high`` is given, they must lie in [0, high].
    """
    array = _array(name, value, shape, "iu", "integers").astype(np.int64)
    if high is not None and array.size and not (array.min() >= 0 and array.max() <= high):
        raise ValueError(f"{name} holds {array.min()} to {array.max()}; expected 0 to {high}")
    return array


def flag_array(name: str, value: object, shape: _Shape) -> np.ndarray:
    """Return ``value`` as a bool array; raise unless it holds 0 and 1 only, and has ``shape``."""
    array = _array(name, value, shape, "biuf", "bool, or 0 and 1")
    wrong = array[(array != 0) & (array != 1)]
    if wrong.size:
        raise ValueError(f"{name} holds {wrong[0]}; expected bool, or 0 and 1")
    return array.astype(bool)


def _array(name: str, value: object, shape: _Shape, kinds: str, expected: str) -> np.ndarray:
    """``value`` as an array of one of the NumPy dtype ``kinds``; an empty one has any dtype."""
    try:
        array = np.asarray(value)
    except (ValueError, TypeError, RuntimeError) as error:  # PyTorch's, of one with a gradient
        raise TypeError(f"{name} cannot be read as an array ({error}); expected one") from error
    if array.size and array.dtype.kind not in kinds:
        raise TypeError(f"{name} has dtype {array.dtype}; expected {expected}")
    shaped(name, array, shape)
    return array


@contextmanager
def needed_for(what: str) -> Iterator[None]:
    """Imports for ``what``: a ModuleNotFoundError names the extra that brings the library."""
    try:
        yield
    except ImportError as error:
        # pandas gives its own error no name.
        said = [error.name] if error.name else re.findall(r"\w+", str(error))
        names = [name for name in EXTRAS if name in said]
        if not names:
            raise
        # Not by the package's name, under which an index may have another one.
        wanted = f'expected it: in the checkout, pip install ".[{EXTRAS[names[0]]}]"'
        message = f"{what} needs {names[0]}, which is not installed; {wanted}"
        raise ModuleNotFoundError(message) from error
