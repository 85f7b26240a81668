"""The checks of the exercises: which answers they take, and what they say of others."""

import importlib
import re

import numpy as np
import pytest
import torch

from notebooks import checks
from notebooks.checks import Exercise, check, judged
from tests.test_notebooks import CHAPTERS, cells
from unload import plain


def said(path, word):
    """The exercises of which the stored outputs of a notebook say a word."""
    outputs = [output for cell in cells(path, "code") for output in cell["outputs"]]
    printed = "".join("".join(output.get("text", "")) for output in outputs)
    return sorted(re.findall(rf"^(\d\d/\d): {word}$", printed, re.MULTILINE))


@pytest.mark.parametrize("path", CHAPTERS, ids=lambda path: path.stem)
def test_each_exercise_awaits_an_answer_and_has_a_solution_that_passes(path):
    track = importlib.import_module(f"notebooks.checks.{checks.TRACKS[path.stem[0]]}")
    names = [name for name in track.EXERCISES if name.startswith(path.stem[:2])]
    assert names == said(path, "not yet") == said(path.parent / "solutions" / path.name, "right")


NINE = {
    checks.number: (lambda answer: answer == 9, [9, 9.0, np.int64(9), np.array([9.0]), "9"]),
    checks.pair: (lambda answer: answer == (9, 1), [(9, 1), [9, 1], np.array([9, 1])]),
    checks.truth: (lambda answer: answer, [True, np.True_, "True"]),
    checks.text: (lambda answer: answer == "nine", ["nine", np.str_("nine")]),
    checks.function: (lambda answer: answer(8) == 9, [lambda value: value + 1]),
}
ANSWERS = [(kind, answer) for kind, (_, answers) in NINE.items() for answer in answers]


@pytest.mark.parametrize(("kind", "answer"), ANSWERS)
def test_answers_of_the_wanted_kind_are_taken_and_others_named(kind, answer):
    wanted = Exercise(kind, NINE[kind][0], "again")
    assert judged(wanted, answer) == "right"
    for wrong in (np.nan, "eight", (1, 2), {}, print, np.zeros((2, 3))):
        assert judged(wanted, wrong).startswith("not yet: ")
    assert judged(wanted, {}) == f"not yet: {{}} is not {kind.__doc__}"


def test_what_is_wrong_is_said_and_stops_a_solution(capsys):
    wanted = Exercise(checks.function, lambda answer: checks.call(answer, 1) == 2, "again")
    for answer, line in (
        (None, "not yet"),
        (lambda value: None, "not yet"),
        (abs, "not yet: abs is not right; again"),
        (lambda value: value / 0, "not yet: it stops in line .* with ZeroDivisionError: .*"),
    ):
        assert re.fullmatch(line, judged(wanted, answer))
    check("03/2", 0.9, strict=True)
    assert capsys.readouterr().out == "03/2: right\n"
    with pytest.raises(AssertionError, match="03/2: not yet: 1.0 is not right; which pooled"):
        check("03/2", np.float32(1), strict=True)
    for name in ("03/9", "99/1", "3"):
        with pytest.raises(ValueError, match=f"no exercise is called '{name}'"):
            check(name, 1)


def test_small_mistakes_in_the_algorithm_are_noticed():
    """Each differs from the page ``unload/plain.py`` in one thing."""
    torch.set_num_threads(1)

    def ignores_the_mask(network, observations, allowed, epsilon, rng):
        return plain.choose(network, observations, np.ones_like(allowed), epsilon, rng)

    def forgets_the_end(network, target, optimizer, picks, gamma):
        picks = [(*pick[:5], np.False_) for pick in picks]
        return plain.update(network, target, optimizer, picks, gamma)

    for number, wrong, line in (
        ("1", ignores_the_mask, "an item that the mask excludes"),
        ("2", forgets_the_end, "the loss of update 1 with γ = 0.5"),
    ):
        assert line in judged(checks.exercise(f"04/{number}"), wrong)
