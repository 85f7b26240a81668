"""The exercises of notebook 01."""

import numpy as np

import unload
from notebooks.checks import Exercise, function, number
from unload import task
from unload.physics.table import TablePhysics, shared_table

WEIGHTS = 1, 4, 16


def best_weight(weight):
    """The one of the weights of z with which the most of 128 visible items can be lifted."""
    load, physics = unload.stack_load(np.random.default_rng(1)), TablePhysics(shared_table())
    physics.reset(load)

    def share(each):
        distance = np.sqrt((task.VIEWPOINT - load.positions) ** 2 @ np.array([1, 0, each]))
        visible = np.argsort(distance, kind="stable")[:128].tolist()
        return np.mean([physics.lift(item) >= task.LIFT_THRESHOLD for item in visible])

    return weight == max(WEIGHTS, key=share)


def seldom_succeeds(policy):
    return unload.evaluate(policy, 2, 1, max_picks=100)["success_rate"].mean() < 0.05


EXERCISES = {
    "1": Exercise(number, best_weight, "move the slider"),
    "2": Exercise(function, seldom_succeeds, "observations[..., 2] is the height; obey the masks"),
}
