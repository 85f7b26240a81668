"""The check of a reader's answer to an exercise of a notebook."""

from collections.abc import Callable


def check(name: str, answer: object, right: Callable[[object], bool], hint: str) -> None:
    """Print in one line that an answer is right, or that there is none yet.

    A notebook stands with ``answer = None`` in its exercises, so that it runs from end to end
    before they are solved.

    Args:
        name: of the exercise, such as ``"Exercise 1"``.
        answer: the reader's, None while there is none.
        right: whether an answer is right; not asked while there is none.
        hint: what to look at again, for a wrong answer.

    Raises:
        AssertionError: the answer is wrong; the message gives it and the hint.
    """
    if answer is None:
        print(f"{name}: not yet")
        return
    if not right(answer):
        raise AssertionError(f"{name}: {answer!r} is not right; {hint}")
    print(f"{name}: right")
