"""The exercises of notebook 12."""

from notebooks.checks import Exercise, number, text

EXERCISES = {
    "1": Exercise(
        text,
        lambda change: change == "equalize=False",
        "compare unload.evaluate(policy, mask=False) of the two",
    ),
    "2": Exercise(number, lambda largest: largest == 0, "were both runs of the same PICKS?"),
}
