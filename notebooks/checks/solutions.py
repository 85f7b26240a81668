"""The functions that solve exercises of notebook 04, shown to whoever asks for one by its name."""

import html
import inspect
from collections.abc import Callable

from IPython.display import HTML, display

from notebooks.checks import MISSING, exercise, judged
from unload import plain

NAMES = {"04/1": "choose", "04/2": "update", "04/3": "masked_dqn", "pick": "pick"}


def solution(name: str) -> None:
    """Show the function that solves an exercise, such as ``"04/2"``, or the given ``"pick"``.

    Raises:
        ValueError: no function stands for this name.
    """
    code = html.escape(inspect.getsource(_function(name)))
    display(HTML(f"<details open><summary>{name}</summary><pre>{code}</pre></details>"))


def stand_in(name: str, mine: Callable | None = None) -> Callable:
    """Return the function to go on with: that of ``solution``, unseen, or the reader's.

    Args:
        name: see ``solution``.
        mine: the reader's, right or wrong; not taken while it has no body.

    Raises:
        ValueError: no function stands for this name.
    """
    chosen, whose = _function(name), "the solution's"
    if mine is not None and judged(exercise(name), mine) != MISSING:
        chosen, whose = mine, "your"
    print(f"from here on: {whose} `{chosen.__name__}`")
    return chosen


def _function(name: str) -> Callable:
    if name not in NAMES:
        known = ", ".join(map(repr, NAMES))
        raise ValueError(
            f"there is no function for {name!r}; expected {known}. "
            "Other solutions stand in notebooks/solutions"
        )
    return getattr(plain, NAMES[name])
