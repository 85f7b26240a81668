"""The exercise of notebook 22 that has an answer."""

from notebooks.checks import Exercise, pair

EXERCISES = {"1": Exercise(pair, lambda kept: kept == (16 * 16, 128 * 16), "see section 4")}
