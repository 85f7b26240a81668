"""The checks of the exercises: which answers they take, and what they say of others."""

import importlib
import inspect
import re
import sys
from unittest.mock import patch

import numpy as np
import pandas as pd
import pytest
import torch

from notebooks import checks
from notebooks.checks import Exercise, check, judged
from notebooks.checks.solutions import NAMES, solution, stand_in
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


@pytest.mark.parametrize(
    ("name", "right", "wrong"),
    [
        ("10/1", [(2, 0.5), [2.0, 0.9]], [2, (2, 0.2), (3, 0.5), (2, 0.95)]),
        ("12/1", ["equalize=False", "equalize = False", '"equalize=False"'], ["mask=True"]),
        ("12/2", [0, 0.0], [1e-3]),
        ("13/1", [11], [10, 12]),
        ("13/2", [18, 18.4], [0.184, 20]),
        ("20/1", [0.0016, 0.002], [0.196, 1]),
        ("21/1", [0.2145, 0.21, 0.22, 0.23], [0.25, 1.86]),  # with and without the column of nets
    ],
)
def test_answers_that_differ_in_little_are_judged_by_what_was_asked(name, right, wrong):
    """As figures and tables print them, too."""
    assert {judged(checks.exercise(name), answer) for answer in right} == {"right"}
    assert "right" not in {judged(checks.exercise(name), answer) for answer in wrong}


def test_an_empty_loop_is_said_to_be_empty_where_it_is_used():
    def masked_dqn(
        envs, network, steps, seeds, gamma=0.0, mask=True, batch_size=64, size=2**20
    ): ...

    with pytest.raises(checks.Missing, match="masked_dqn returns nothing: its body is still to be"):
        by_checks.by_hand(masked_dqn, by_checks.small(2))
    assert judged(checks.exercise("04/3"), masked_dqn) == "not yet"


def test_runs_that_differ_are_compared_in_a_sentence():
    losses, means, weights = package = np.arange(3.0), np.zeros(4), {"weight": torch.zeros(2)}
    for changed, line in (
        (package, "3 losses and all weights are the same, bit by bit"),
        ((losses[:2], means, weights), "the losses have the shape (2,); expected (3,)"),
        ((losses + [0, 1, 0], means, weights), "the losses differ from update 2 on"),
        (
            (losses, means, {"weight": torch.ones(2)}),
            "the losses agree, the weights at the end do not",
        ),
        ((losses, means[1:], weights), "the mean rewards have the shape (3,); expected (4,)"),
        ((losses, means + [0, 0, 1, 0], weights), "the mean reward of step 3 is 1; expected 0"),
    ):
        assert by_checks.compare(changed, package) == line


MASKED = "np.where(allowed, scores, -np.inf)"
BEST = "target(after).masked_fill(~allowed_after, -torch.inf).amax(dim=1)"
ENDED = "best.masked_fill(terminated, 0)"
MEAN = "np.mean([reward for _, _, reward, *_ in picks])"
MISTAKES = [  # in ``plain``: what is replaced, by what, and what is said
    ("choose", MASKED, "scores", "ε = 0.0 it chooses an item that the mask excludes"),
    ("choose", MASKED, "np.where(allowed, scores, 0)", "ε = 0.0 it chooses an item that the mask"),
    ("choose", MASKED, "np.where(allowed, scores, -1)", "ε = 0.0 it chooses an item that the mask"),
    ("choose", "allowed, scores", "allowed | explore[:, None], scores", "ε = 0.5 it chooses an"),
    ("choose", "< epsilon", "> epsilon", " of 64 actions differ from the package"),
    ("choose", "axis=1", "axis=0", "it returns actions of shape (128,); expected (64,)"),
    (
        "choose", "rng.random(scores[explore].shape)", "rng.random(scores.shape)[explore]",
        "the count of random numbers drawn is not; expected one an environment",
    ),
    ("update", BEST, "target(after).amax(dim=1)", "the mask is forgotten, and the maximum"),
    ("update", "~allowed_after", "allowed_after", "the mask is inverted"),
    ("update", BEST, "(target(after) * allowed_after).amax(dim=1)", "what the mask excludes has"),
    ("update", "target(after)", "network(after)", "is that of the network; expected the target"),
    ("update", "target(after)", "target(before)", "the maximum is that of the state before"),
    ("update", ENDED, "best", "γ = 0.0 is nan: where the episode has ended, nothing is free and"),
    ("update", f"{BEST}\n    goal = reward + gamma * {ENDED}",
     "target(after).amax(dim=1)\n    goal = reward + gamma * best", "mask and end of the episode"),
    ("update", "-torch.inf).amax(dim=1)\n    goal = reward + gamma * " + ENDED,
     "-1e9).amax(dim=1)\n    goal = reward + gamma * best", "e+07: where the episode has ended"),
    ("update", "smooth_l1_loss", "torch.nn.functional.mse_loss", "the loss is the squared error"),
    ("update", "values, goal", "values, goal, reduction='sum'", "a sum; expected a mean"),
    ("update", "gamma * ", "", "γ is missing"),
    ("update", "gather(1", "gather(0", "; the goal is the reward here"),
    ("update", ".amax(dim=1)", ".logsumexp(dim=1)", "; with γ = 0 it is right"),
    ("update", "with torch.no_grad()", "if True", "it computes gradients of the target network"),
    ("update", "loss.item()", "loss", "it returns a Tensor; expected the loss as a float"),
    ("update", "optimizer.step()", "optimizer.step(), optimizer.step()", "weights afterwards are"),
    ("update", "optimizer.zero_grad()", "", "update 2 with γ = 0.0 is right, the weights after"),
    ("update", "optimizer.step()", "", "the weights do not change: zero_grad, backward, step"),
    ("masked_dqn", "(step + 1)", "step", "update 150 on; look at γ and the target network"),
    ("masked_dqn", "1 - step", "1 - (step + 1)", "positions: the losses differ from update 1 on"),
    ("masked_dqn", "size=batch_size", "size=64", "a short memory: the losses differ from update 1"),
    ("masked_dqn", ") % size", ")", "a short memory: the losses differ from update 7 on; look at"),
    ("masked_dqn", "epsilon, mask", "epsilon, True", "positions: the losses differ from"),
    ("masked_dqn", MEAN, "0.0", "the mean reward of step 1 is 0; expected -0.5"),
    ("masked_dqn", MEAN, "picks[0][2]", "the mean reward of step 1 is 1; expected -0.5"),
    ("masked_dqn", MEAN, "[each[2] for each in picks]", "have the shape (20, 64); expected (20,)"),
    ("masked_dqn", ", np.array(means)", "", "it returns ndarray; expected losses and mean rewards"),
]  # fmt: skip
SAME = [
    ("choose", "-np.inf", "-2.0"),
    ("choose", ".argmax(axis=1)", ".argmax(axis=1).tolist()"),
    (
        "update",
        f"reward + gamma * {ENDED}",
        "torch.where(terminated, reward, reward + gamma * best)",
    ),
    ("update", "amax(dim=1)", "max(dim=1).values"),
    ("masked_dqn", "np.array(losses), np.array(means)", "losses, means"),
]
NUMBERS = {function: name for name, function in NAMES.items()}


def said_of(function, old, new):
    """What the check says of a function of ``plain`` that is written otherwise in one place."""
    source, namespace = inspect.getsource(getattr(plain, function)), dict(vars(plain))
    assert source.count(old) == 1
    exec(source.replace(old, new), namespace)
    return judged(checks.exercise(NUMBERS[function]), namespace[function])


@pytest.mark.parametrize(("function", "old", "new", "said"), MISTAKES)
def test_mistakes_in_the_algorithm_are_noticed_and_named(function, old, new, said):
    assert said in said_of(function, old, new)


@pytest.mark.parametrize(("function", "old", "new"), SAME)
def test_the_algorithm_may_be_written_otherwise(function, old, new):
    assert said_of(function, old, new) == "right"


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
        ("30/3", {"setting": ["a", "a"]}, "'a' has two rows; expected one a setting"),
        ("30/3", {"verdict": "yes"}, "is 'yes'; expected one of 'holds', 'refuted', 'open'"),
    ):
        assert said in judged(checks.exercise(name), pd.DataFrame(good[name] | changed))
    few = pd.DataFrame(good["30/2"]).query("seed < 20_005")
    assert "5 seeds of a setting; expected 10" in judged(checks.exercise("30/2"), few)
    alone = pd.DataFrame(good["30/2"]).query("setting == 'a'")
    assert "one setting; expected a control" in judged(checks.exercise("30/2"), alone)


def test_what_has_been_solved_is_listed(own_data, capsys):
    """A wrong answer later changes nothing, and the solutions' own answers do not count."""
    check()
    assert "\n03  – – –\n04  – – – –\n" in capsys.readouterr().out
    for name, answer in (("03/2", 0.9), ("03/2", 1), ("10/1", (2, 0.5)), ("10/1", (2, 0.5))):
        check(name, answer)
    check("04/4", 2 / 3, strict=True)
    capsys.readouterr()
    check()
    lines = capsys.readouterr().out.splitlines()
    assert [line for line in lines if re.search(r"  .*\d", line)] == ["03  – 2 –", "10  1 –"]
    assert len(lines) == len(CHAPTERS)


def test_a_solution_is_shown_to_whoever_asks_and_stands_in_unseen(capsys):
    def update(network, target, optimizer, picks, gamma): ...

    def choose(network, observations, allowed, epsilon, rng):
        return 7

    for mine in (None, update):
        assert stand_in("04/2", mine) is plain.update
        assert capsys.readouterr().out == "from here on: the solution's `update`\n"
    assert stand_in("04/1", choose) is choose
    assert capsys.readouterr().out == "from here on: your `choose`\n"
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
        ("02/3", lambda heights: np.arange(len(heights)), "index and rank differ in"),
        ("05/2", (0.493, 1.0), "both are right, in the wrong order; expected positions first"),
        ("05/2", (0.9, 0.9), "the preference is along x, c = 0: rule(0, 1)"),
        ("05/3", of_one_container, "expected an array of 2 actions, one a container"),
        ("12/1", "mask=True", "in new containers, with the mask and without"),
        ("12/2", 0.1, "the same configuration, and the second call the folder of the first"),
        ("13/1", 12, "the first point below 5 % in the figure of section 2"),
        ("13/2", 0.184, "in points"),
        ("20/1", 0.196, "evaluate with mask=False"),
        ("21/1", 1.86, "section 3 has the training heaps, section 5 the unseen ones"),
    ):
        assert said in judged(checks.exercise(name), wrong), name
