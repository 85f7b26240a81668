"""The exercises of notebook 02."""

import numpy as np

import unload
from notebooks.checks import Exercise, call, function


def equalizes(equalized):
    """Whether a function is Algorithm 1, where equal values share the mean of their ranks."""
    rng = np.random.default_rng(0)
    for items in (2, 7, 128, 128):
        positions = rng.integers(items, size=(items, 3)) / items
        expected = unload.equalize(positions, "average")
        got = np.asarray(call(equalized, positions.copy()))
        if got.shape != expected.shape:
            return f"of {positions.shape} positions it makes {got.shape} values"
        wrong = np.abs(got - expected).max(axis=1) > 1e-6
        if wrong.any():
            row = int(wrong.argmax())
            return (
                f"of {items} items, item {row} at {positions[row].round(3)} "
                f"becomes {got[row].round(3)}; expected {expected[row].round(3)}"
            )
    return True


def leaves_the_ranks(change):
    values = np.random.default_rng(0).uniform(-1, 1, 128)
    changed = np.asarray(call(change, values.copy()))
    same = np.array_equal(unload.equalize(changed[:, None]), unload.equalize(values[:, None]))
    return same and not np.allclose(changed, values)


EXERCISES = {
    "1": Exercise(function, equalizes, ""),
    "2": Exercise(function, leaves_the_ranks, "which functions keep the order of numbers?"),
}
