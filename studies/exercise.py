"""The check of a reader's answer to an exercise of a notebook."""

from collections.abc import Callable


def check(
    name: str, answer: object, right: Callable[[object], bool], hint: str, *, strict: bool = False
) -> None:
    """Print in one line whether an answer is right, or that there is none yet.

    A notebook stands with ``answer = None`` in its exercises, so that it runs from end to end
    before they are solved, and a wrong answer does not stop it.

    Args:
        name: of the exercise, such as ``"Exercise 1"``.
        answer: the reader's, None while there is none.
        right: whether an answer is right; not asked while there is none.
        hint: what to look at again, for a wrong answer.
        strict: raise an error for a wrong answer, as the solutions do.

    Raises:
        AssertionError: the answer is missing or wrong, and ``strict``; the message gives the hint.
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
