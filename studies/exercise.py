"""The check of a reader's answer to an exercise of a notebook."""

from collections.abc import Callable


def check(
    name: str, answer: object, right: Callable[[object], bool], hint: str, *, strict: bool = False
) -> None:
    """Print in one line whether the answer to the exercise ``name`` is right, or still missing.

    A notebook stands with ``answer = None`` in its exercises, so that it runs from end to end
    before they are solved, and a wrong answer does not stop it.

    Args:
        answer: the reader's, None while there is none.
        right: whether an answer is right; not asked while there is none.
        hint: what to look at again, for a wrong answer.
        strict: raise an AssertionError if it is missing or wrong, as the solutions do.
    """
    if answer is not None and right(answer):
        print(f"{name}: right")
        return
    message = f"{name}: not yet"
    if answer is not None:
        message += f": {answer!r} is not right; {hint}"
    if strict:
        raise AssertionError(message)
    print(message)
