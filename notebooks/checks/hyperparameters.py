"""The exercises of notebook 11."""

from notebooks.checks import Exercise, number, pair
from studies.paper import tuning


def passes(step):
    return abs((step / 600) + (1 - step / 600) * tuning.chance() - 0.99) < 0.01


def most_scattered(configuration):
    summary = tuning.tuning_summary()
    with_fe = summary[summary["equalize"]].set_index(["batch_size", "learning_rate"])
    return configuration == with_fe["final_msr_std"].idxmax()


EXERCISES = {
    "1": Exercise(number, passes, "ε falls from 1 to 0 between step 0 and step 600"),
    "2": Exercise(pair, most_scattered, "the column is final_msr_std"),
    "3": Exercise(
        number,
        lambda features: features == 1,
        "a feature is a ramp: relu of a weighted sum of x, y and z",
    ),
}
