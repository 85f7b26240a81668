"""The check of a reader's answer."""

import pytest

from studies.exercise import check


def test_an_answer_is_awaited_right_or_wrong(capsys):
    for answer in (None, 4, 5):
        check("Exercise 1", answer, lambda value: value == 4, "count again")
    printed = capsys.readouterr().out.splitlines()
    assert printed[:2] == ["Exercise 1: not yet", "Exercise 1: right"]
    assert printed[2] == "Exercise 1: not yet: 5 is not right; count again"


@pytest.mark.parametrize("answer", [None, 5])
def test_a_wrong_answer_stops_a_solution(answer):
    with pytest.raises(AssertionError, match="Exercise 1: not yet"):
        check("Exercise 1", answer, lambda value: value == 4, "count again", strict=True)
