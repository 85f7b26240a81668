"""The exercises of notebook 05."""

import numpy as np

import unload
from notebooks.checks import Exercise, call, function, number, pair


def along_depth(observations, masks, rng):
    """The rule that picks the highest z + x."""
    scores = observations @ np.array([1, 0, 1], np.float32)
    return np.where(masks.astype(bool), scores, -np.inf).argmax(axis=1)


def both(shares):
    found = [
        unload.evaluate(along_depth, 4, 0, equalize=ranks)["success_rate"].mean()
        for ranks in (False, True)
    ]
    return np.allclose(shares, found, atol=0.02)


def digs_left(rule):
    """Whether a rule never misses in two containers and keeps to the left side."""
    places = []

    def noted(observations, masks, rng):
        actions = np.asarray(call(rule, observations, masks, rng))
        places.extend(observations[np.arange(len(actions)), actions, 1].tolist())
        return actions

    msr = unload.evaluate(noted, 2, 0, max_picks=150)["success_rate"].mean()
    if msr < 1:
        return f"{msr:.1%} of its picks succeed; expected all"
    if np.mean(places) > LEFT:
        return f"the mean y of its picks is {np.mean(places):.2f}; expected {LEFT} or less"
    return True


LEFT = -0.2  # mean y of the picks; -1 is the left side wall

EXERCISES = {
    "1": Exercise(
        number,
        lambda height: abs(height - 0.3 * 1.25 / 2) < 0.005,
        "a step goes half a width to the side and one height up",
    ),
    "2": Exercise(pair, both, "evaluate over 4 containers from seed 0 on"),
    "3": Exercise(function, digs_left, ""),
}
