"""The exercises of the reproduction, notebooks 10 to 13, that have an answer to check."""

import numpy as np
from scipy import stats

from notebooks.checks import Exercise, number, pair, text
from studies.paper import tuning
from studies.results import read_table
from unload import task

# Notebook 10


def tells_one_from_two(answer):
    """Whether 30 N lift so many boxes by 0.2 m, and only one by the threshold: 0.917, 0.236 m."""
    boxes, threshold = answer
    if boxes != 2:
        return f"30 N do not unload {boxes:g} boxes at once; move the slider of section 3 to 30 N"
    return 0.236 < threshold < 0.917 or f"{threshold:g} m does not lie between the two distances"


def on_the_moon(forces):
    one = task.MASS * (1.62 + 2 * task.LIFT_THRESHOLD / task.LIFT_TIME**2)
    return np.allclose(forces, (one, 2 * one), atol=0.1)


# Notebook 11


def passes(step):
    return abs((step / 600) + (1 - step / 600) * tuning.chance() - 0.99) < 0.01


def most_scattered(configuration):
    summary = tuning.tuning_summary()
    with_fe = summary[summary["equalize"]].set_index(["batch_size", "learning_rate"])
    return configuration == with_fe["final_msr_std"].idxmax()


# Notebook 13


def enough(seeds):
    """Whether it is the least number of seeds, by the exact shares."""
    runs = read_table("falls/laboratory")
    holds = runs.loc[runs["cell"] == "averaged", "end"] >= 0.99
    both = stats.hypergeom.pmf([seeds, seeds - 1], len(holds), holds.sum(), [seeds, seeds - 1])
    return both[0] < 0.05 <= both[1]


def gained(points):
    """Whether it is by how much networks of averaged ties do better where the mask is on."""
    runs = read_table("falls/laboratory")
    off, on = (
        runs.loc[runs["cell"] == cell, "judged_as_is"].mean()
        for cell in ("averaged_no_mask", "averaged")
    )
    return abs(points - 100 * (on - off)) < 1


EXERCISES = {
    "10/1": Exercise(pair, tells_one_from_two, ""),
    "10/2": Exercise(
        pair, on_the_moon, "solve the formula of section 1 for the force, for p = 1, 2"
    ),
    "11/1": Exercise(number, passes, "ε falls from 1 to 0 between step 0 and step 600"),
    "11/2": Exercise(pair, most_scattered, "the column is final_msr_std"),
    "11/3": Exercise(
        number,
        lambda features: features == 1,
        "a feature is a ramp: relu of a weighted sum of x, y and z",
    ),
    "12/1": Exercise(
        text,
        lambda change: "".join(change.split()).strip("\"'") == "equalize=False",
        "apply both in new containers, with the mask and without; compare each with the live run",
    ),
    "12/2": Exercise(
        number,
        lambda largest: largest == 0,
        "both runs need the same configuration, and the second call the folder of the first",
    ),
    "13/1": Exercise(number, enough, "the first point below 5 % in the figure of section 2"),
    "13/2": Exercise(number, gained, "in points, that is, 100 times a difference of shares"),
}
