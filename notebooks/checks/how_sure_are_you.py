"""The exercise of notebook 13 that has an answer in one number."""

from scipy import stats

from notebooks.checks import Exercise, number
from studies.results import read_table


def enough(seeds):
    """Whether it is the least number of seeds, give or take one."""
    runs = read_table("falls/laboratory")
    holds = runs.loc[runs["cell"] == "averaged", "end"] >= 0.99
    both = stats.hypergeom.pmf([seeds, seeds - 2], len(holds), holds.sum(), [seeds, seeds - 2])
    return both[0] < 0.06 < both[1]


EXERCISES = {
    "1": Exercise(number, enough, "look for the first point below 5 % in the figure of section 2")
}
