"""The exercises of notebook 00."""

import numpy as np

import unload
from notebooks.checks import Exercise, number
from studies.play.episode import Run


def runs(player, picks, **options):
    """A player's runs on 20 loads."""
    played = []
    for seed in range(20):
        run = Run(player, unload.stack_load(np.random.default_rng(seed)), seed, **options)
        run.play_to(picks)
        played.append(run)
    return played


def successes(mean):
    return abs(mean - np.mean([run.unloaded() for run in runs("random", 50)])) < 1.5


def deadlocks(loads):
    played = runs("the paper's agent, seed 3", 100, mask=False)
    return loads == sum(any(pick.deadlocked for pick in run.picks) for run in played)


EXERCISES = {
    "1": Exercise(number, successes, "load and run have the same seed, 0 to 19"),
    "2": Exercise(number, deadlocks, "did you give mask=False?"),
}
