"""The check of a reader's answer."""

import pytest

from unload.reproduce.exercise import check


def test_an_answer_is_awaited_right_or_wrong(capsys):
    for answer in (None, 4):
        check("Exercise 1", answer, lambda value: value == 4, "count again")
    assert capsys.readouterr().out == "Exercise 1: not yet\nExercise 1: right\n"
    with pytest.raises(AssertionError, match="Exercise 1: 5 is not right; count again"):
        check("Exercise 1", 5, lambda value: value == 4, "count again")
