"""The checks of the exercises: which answers they take, and what they say of others."""

import importlib
import re
import sys
from unittest.mock import patch

import numpy as np
import pandas as pd
import pytest
import torch

from notebooks import checks
from notebooks.checks import Exercise, check, judged
from notebooks.checks.solutions import solution, stand_in
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


by_checks = importlib.import_module("notebooks.checks.masked_dqn")
NINE = {
    checks.number: (lambda answer: answer == 9, [9, 9.0, np.int64(9), np.array([9.0]), "9"]),
    checks.pair: (lambda answer: answer == (9, 1), [(9, 1), [9, 1], np.array([9, 1])]),
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


def test_what_needs_pybullet_is_not_called_wrong_where_it_is_missing(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "pybullet", None)
    check("21/2", lambda observations, masks, rng: observations[:, :, 2].argmin(axis=1))
    assert capsys.readouterr().out.startswith("21/2: cannot be checked here: heaps are")


def test_what_stops_is_shown_as_the_readers_own_line():
    """And not as one of the check, or of what the function calls."""

    def shaped(values):
        return np.reshape(values, (5, 5))

    wanted = Exercise(checks.function, lambda answer: checks.call(answer, np.arange(4)).any(), "")
    said, line = judged(wanted, shaped), shaped.__code__.co_firstlineno + 1
    start = f"not yet: it stops in line {line}, 'return np.reshape(values, (5, 5))', with Value"
    assert said.startswith(start)
    typed = {}
    exec("def three(values): return 3", typed)
    said = judged(wanted, typed["three"])
    assert "three gives what the check cannot use (AttributeError: 'int' object has no" in said
    assert "gives what the check cannot use (AssertionError)" in judged(
        Exercise(checks.number, lambda value: exec("assert value < 0", {"value": value}), ""), 1
    )


def test_answers_that_differ_in_little_are_judged_by_what_was_asked():
    for name, right, wrong in (
        ("10/1", [(2, 0.5), [2.0, 0.9]], [2, (2, 0.2), (3, 0.5), (2, 0.95)]),
        ("12/1", ["equalize=False", "equalize = False", '"equalize=False"'], ["mask=True"]),
        ("13/1", [11], [10, 12]),
    ):
        said = [judged(checks.exercise(name), answer) for answer in right + wrong]
        assert [each == "right" for each in said] == [True] * len(right) + [False] * len(wrong)


def test_an_empty_loop_is_said_to_be_empty_where_it_is_used():
    def masked_dqn(
        envs, network, steps, seeds, gamma=0.0, mask=True, batch_size=64, size=2**20
    ): ...

    with pytest.raises(checks.Missing, match="masked_dqn returns nothing: its body is still to be"):
        by_checks.by_hand(masked_dqn, by_checks.small(2))
    assert judged(checks.exercise("04/3"), masked_dqn) == "not yet"


def test_runs_that_differ_are_compared_in_a_sentence():
    weights, losses = {"weight": torch.zeros(2)}, np.arange(3.0)
    for changed, line in (
        ((losses, weights), "3 losses and all weights are the same, bit by bit"),
        ((losses[:2], weights), "there are 2 losses; expected 3"),
        ((losses + [0, 1, 0], weights), "the losses differ from update 2 on"),
        ((losses, {"weight": torch.ones(2)}), "the losses agree, the weights at the end do not"),
    ):
        assert by_checks.compare(*changed, losses, weights) == line


def test_mistakes_in_the_algorithm_are_noticed():
    """Each differs from the page in one thing; some show in an emptied container alone.

    Others show in the losses' type, or where the replay memory is full.
    """
    torch.set_num_threads(1)

    def ignores_the_mask(network, observations, allowed, epsilon, rng):
        return plain.choose(network, observations, np.ones_like(allowed), epsilon, rng)

    def forgets_the_end(network, target, optimizer, picks, gamma):
        picks = [(*pick[:5], np.False_) for pick in picks]
        return plain.update(network, target, optimizer, picks, gamma)

    def returns_a_tensor(*given):
        return torch.tensor(plain.update(*given))

    def remembers_all(*given, size, **options):
        return plain.masked_dqn(*given, **options)

    for number, wrong, line in (
        ("1", ignores_the_mask, "an item that the mask excludes"),
        ("2", forgets_the_end, "of update 1 with γ = 0.0 is nan where the episode has ended"),
        ("2", returns_a_tensor, "it returns a Tensor; expected the loss as a float"),
        ("3", remembers_all, f"positions, size = {by_checks.SMALL}: the losses differ from update"),
    ):
        assert line in judged(checks.exercise(f"04/{number}"), wrong)


def test_a_plan_runs_and_an_answer_are_judged_by_their_form():
    """Each change makes of what is in form what is not, and the sentence says where."""
    seeds = range(20_000, 20_010)
    good = {
        "30/1": {"setting": ["as it is", "slow"], "prediction": "-", "refuted if": "below 0.5"},
        "30/2": {"setting": ["a"] * 10 + ["b"] * 10, "seed": [*seeds, *seeds], "msr": 0.5},
        "30/3": {
            "setting": ["a", "b"], "runs": 10, "value": 0.5, "low": 0.4, "high": 0.6,
            "verdict": "open",
        },
    }  # fmt: skip
    for name, columns in good.items():
        assert judged(checks.exercise(name), pd.DataFrame(columns)) == "right"
        assert judged(checks.exercise(name), columns).endswith(
            "is not a table, a DataFrame of pandas"
        )
        for column in columns:
            short = pd.DataFrame(columns).drop(columns=column)
            assert f"no column '{column}'" in judged(checks.exercise(name), short)
        assert "has no row" in judged(checks.exercise(name), pd.DataFrame(columns).head(0))
    for name, changed, said in (
        (
            "30/1",
            {"refuted if": "it does worse"},
            "'as it is' has no number in it: 'it does worse'",
        ),
        ("30/1", {"setting": ["slow", "slow"]}, "one setting; expected a control"),
        ("30/2", {"setting": ["a"] * 20}, "the same seed twice"),
        ("30/2", {"seed": range(20_000, 20_020)}, "'b' has other seeds than 'a'"),
        ("30/2", {"seed": [*range(10)] * 2}, "the seed 0 has been seen before"),
        ("30/2", {"msr": 95.0}, "an MSR is 95.0; expected a share"),
        ("30/2", {"msr": np.nan}, "the column 'msr' has an empty cell"),
        ("30/3", {"low": 0.55}, "of 'a' the value 0.5 is not within 0.55 to 0.6"),
        ("30/3", {"low": 0.5, "high": 0.5}, "has no width"),
        ("30/3", {"runs": 3}, "'a' has 3 runs; expected 10 or more"),
        ("30/3", {"verdict": "yes"}, "is 'yes'; expected one of 'holds', 'refuted', 'open'"),
    ):
        assert said in judged(checks.exercise(name), pd.DataFrame(good[name] | changed))
    few = pd.DataFrame(good["30/2"]).query("seed < 20_005")
    assert "5 seeds of a setting; expected 10" in judged(checks.exercise("30/2"), few)
    alone = pd.DataFrame(good["30/2"]).query("setting == 'a'")
    assert "one setting; expected a control" in judged(checks.exercise("30/2"), alone)


def test_a_solution_is_shown_to_whoever_asks_and_stands_in_unseen(capsys):
    assert stand_in("04/2") is plain.update
    assert capsys.readouterr().out == "from here on: the solution's `update`\n"
    with patch("notebooks.checks.solutions.display") as display:
        assert solution("04/2") is None
    assert "def update(network, target" in display.call_args.args[0].data
    with pytest.raises(ValueError, match="no function for '04/4'; expected '04/1', '04/2'"):
        solution("04/4")


def test_a_scorer_must_let_a_third_item_decide():
    right = judged(checks.exercise("03/3"), lambda features, mean: np.abs(features - mean))
    linear = judged(checks.exercise("03/3"), lambda features, mean: features + mean)
    single = judged(checks.exercise("03/3"), lambda features, mean: mean)
    assert right == "right" and "can it prefer the item that is farthest" in linear
    assert "of 3 features it makes values of shape ()" in single


def test_plausible_mistakes_are_named_as_what_they_are():
    def of_one_container(observations, masks, rng):
        return np.where(masks.astype(bool), observations[..., 2], np.inf).argmin()

    def scores_of_all_containers(observations, masks, rng):
        return observations[..., 2]

    for name, wrong, said in (
        ("00/1", 302, "302 looks like the sum over 20 loads; expected their mean"),
        ("00/1", 40, "the same seed, 0 to 19; play to 50"),
        ("00/2", 0.15, "0.15 is not a number of loads; expected one of 0 to 20"),
        ("01/2", of_one_container, "asked about 2 containers it returns int64 of shape ()"),
        (
            "01/2",
            scores_of_all_containers,
            "float32 of shape (2, 128); expected an array of 2 actions",
        ),
        ("02/2", lambda values: values, "it keeps the order of values, but changes none of them"),
        ("02/2", np.sum, "of 128 values it makes an array of shape ()"),
        ("02/2", np.negative, "which functions keep the order of numbers?"),
        ("05/2", (0.493, 1.0), "both are right, in the wrong order; expected positions first"),
        ("05/2", (0.9, 0.9), "the preference is along x, c = 0: rule(0, 1)"),
        ("05/3", of_one_container, "expected an array of 2 actions, one a container"),
    ):
        assert said in judged(checks.exercise(name), wrong), name


def test_random_numbers_that_nobody_needs_are_noticed():
    """Scores drawn for all environments, of which those that explore use theirs."""

    def draws_for_all(network, observations, allowed, epsilon, rng):
        explore = rng.random(len(allowed)) < epsilon
        with torch.no_grad():
            scores = network(torch.from_numpy(observations)).numpy()
        scores[explore] = rng.random(scores.shape)[explore]
        return np.where(allowed, scores, -np.inf).argmax(axis=1)

    said = judged(checks.exercise("04/1"), draws_for_all)
    assert (
        "with ε = 0.0 actions are right, the count of random numbers drawn is not; expected" in said
    )

    def others(*given):
        return (plain.choose(*given) * 0) + 7

    assert "of 64 actions differ from the package's" in judged(checks.exercise("04/1"), others)


def test_answers_as_figures_and_tables_print_them_are_taken_and_hints_lead_on():
    for name, right, wrong in (
        ("12/2", [0, 0.0], [1e-3]),
        ("13/2", [18, 18.4], [0.184, 20]),
        ("20/1", [0.0016, 0.002], [0.196, 1]),
        ("21/1", [0.2145, 0.21, 0.22, 0.23], [0.25, 1.86]),  # with and without the column of nets
    ):
        said = [judged(checks.exercise(name), answer) for answer in right + wrong]
        assert [each == "right" for each in said] == [True] * len(right) + [False] * len(wrong)
    for name, wrong, hint in (
        ("12/1", "mask=True", "in new containers, with the mask and without"),
        ("12/2", 0.1, "the same configuration, and the second call the folder of the first"),
        ("13/1", 12, "the first point below 5 % in the figure of section 2"),
        ("13/2", 0.184, "in points"),
        ("20/1", 0.196, "evaluate with mask=False"),
        ("21/1", 1.86, "section 3 has the training heaps, section 5 the unseen ones"),
    ):
        assert hint in judged(checks.exercise(name), wrong)
