"""The checks of the exercises, one file a track, called by name: ``check("06/1", answer)``.

Its ``EXERCISES`` say of each exercise which kind of answer is wanted, when it is right, and what to
look at again; the solutions pass the same. ``check()`` lists what has been solved in all notebooks.
"""

import importlib
import os
import traceback
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from studies import paths

# By the first digit of a notebook.
TRACKS = {"0": "core", "1": "reproduction", "2": "beyond", "3": "capstone"}
MISSING = "not yet"  # said of an answer that is still to be given
SOLVED = "solved.txt"  # in ``runs/``: a name a line
REDUCED = "UNLOAD_REDUCED"  # set where a notebook runs at reduced counts


class Exercise(NamedTuple):
    """What an exercise wants: a ``kind`` of answer, when it is ``right``, and a ``hint``.

    ``right`` returns whether the answer is right, or says in a sentence what is not.
    """

    kind: Callable[[Any], Any]
    right: Callable[[Any], bool | str]
    hint: str


class Unusable(Exception):
    """What a function returns cannot be judged; it says why."""


class NotHere(Exception):
    """No answer can be judged on this machine; it says why."""


class Missing(Exception):
    """A function that is to be written has an empty body still; it says which."""


def check(name: str | None = None, answer: object = None, *, strict: bool = False) -> None:
    """Print in one line whether the answer to an exercise is right, wrong or still missing.

    A wrong answer does not stop a notebook, nor does one of a wrong kind, or a function that fails.
    Without a name, print which exercises have been solved.

    Args:
        name: number of the notebook and of the exercise, such as ``"06/1"``.
        answer: the reader's; None, or a function without a body, while there is none.
        strict: raise an AssertionError if it is missing or wrong, as the solutions do. At reduced
            counts, where ``REDUCED`` is set in the environment, answers may be others.

    Raises:
        ValueError: there is no such exercise.
    """
    if name is None:
        print(solved())
        return
    said = judged(exercise(name), answer)
    if said == "right" and not strict:
        _note(name)
    if strict and said != "right" and REDUCED not in os.environ:
        raise AssertionError(f"{name}: {said}")
    print(f"{name}: {said}")


def solved() -> str:
    """The numbers of the solved exercises, a line for each notebook; a dash stands for others."""
    noted = _noted()
    lines: dict[str, list[str]] = {}
    for track in TRACKS.values():
        for name in importlib.import_module(f"{__name__}.{track}").EXERCISES:
            notebook, number = name.split("/")
            lines.setdefault(notebook, []).append(number if name in noted else "–")
    return "\n".join(f"{notebook}  {' '.join(numbers)}" for notebook, numbers in lines.items())


def _noted() -> set[str]:
    """The names of the exercises that a reader has solved in this checkout."""
    file = paths.RUNS / SOLVED
    return set(file.read_text(encoding="utf-8").split()) if file.exists() else set()


def _note(name: str) -> None:
    paths.RUNS.mkdir(exist_ok=True)
    (paths.RUNS / SOLVED).write_text("\n".join(sorted(_noted() | {name})), encoding="utf-8")


def exercise(name: str) -> Exercise:
    """An exercise by its name, such as ``"06/1"``."""
    track = TRACKS.get(name[:1])
    exercises = importlib.import_module(f"{__name__}.{track}").EXERCISES if track else {}
    if name not in exercises:
        raise ValueError(f'check(): no exercise is called {name!r}; expected one such as "06/1"')
    return exercises[name]


def judged(wanted: Exercise, answer: object) -> str:
    """What is said of an answer: ``"right"``, ``"not yet"`` and why, or why none can be judged."""
    if answer is None:
        return MISSING
    try:
        given = wanted.kind(answer)
    except (TypeError, ValueError):
        return f"not yet: {_called(answer)} is not {wanted.kind.__doc__}"
    try:
        right = wanted.right(given)
    except Missing:
        return MISSING
    except NotHere as error:
        return f"cannot be checked here: {error}"
    except Unusable as error:
        return f"not yet: {error}"
    except Exception as error:
        return f"not yet: {_stopped(answer, error)}"
    if isinstance(right, str):
        return f"not yet: {right}"
    return "right" if right else f"not yet: {_called(answer)} is not right; {wanted.hint}"


def _stopped(answer: object, error: Exception) -> str:
    """Where a reader's function stops, as a line of its own, and why."""
    said = f"{type(error).__name__}: {error}".rstrip(": ")
    file = answer.__code__.co_filename if hasattr(answer, "__code__") else None
    own = [line for line in traceback.extract_tb(error.__traceback__) if line.filename == file]
    if not own:
        return f"{_called(answer)} gives what the check cannot use ({said})"
    return f"it stops in line {own[-1].lineno}, {own[-1].line!r}, with {said}"


def _called(answer: object) -> str:
    if callable(answer):
        return getattr(answer, "__name__", "the function")
    return f'"{answer}"' if isinstance(answer, str) else str(answer)


def call(function: Callable, *args: object, **kwargs: object) -> Any:
    """What a reader's function returns.

    Raises:
        Missing: nothing.
    """
    returned = function(*args, **kwargs)
    if returned is None:
        raise Missing(f"{_called(function)} returns nothing: its body is still to be written")
    return returned


# Kinds of answers; the docstring says what is wanted.


def number(answer: object) -> float:
    """a number"""
    if isinstance(answer, (bool, np.bool_)) or callable(answer):
        raise TypeError
    return float(np.asarray(answer, dtype=float).reshape(()))


def pair(answer: Any) -> tuple[float, float]:
    """a pair of numbers"""
    values = np.asarray(list(answer), dtype=float)
    first, second = values.tolist()
    return first, second


def numbers(answer: Any) -> list[float]:
    """a list of numbers"""
    return np.asarray(list(answer), dtype=float).reshape(-1).tolist()


def text(answer: object) -> str:
    """a text in quotation marks"""
    if not isinstance(answer, str):
        raise TypeError
    return str(answer)


def function(answer: object) -> Callable:
    """a function"""
    if not callable(answer):
        raise TypeError
    return answer
