"""The exercises of notebook 06."""

import unload
from notebooks.checks import Exercise, number
from studies.falls import measures


def msr(along_x, along_y, ties="noise"):
    policy = measures.preferring(along_x, along_y, ties)
    return unload.evaluate(policy, 2)["success_rate"].mean()


EXERCISES = {
    "1": Exercise(
        number,
        lambda least: msr(0, least) < 0.95 <= msr(0, least - 0.1),
        "the title of the figure gives the MSR",
    ),
    "2": Exercise(
        number,
        lambda share: abs(share - msr(1.5, 0, "average")) < 0.01,
        "all boxes of a wall share x, and now its rank, too",
    ),
}
