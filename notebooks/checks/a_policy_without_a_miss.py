"""The exercises of notebook 20."""

import unload
from notebooks.checks import Exercise, call, function, number
from unload import policies


def beats_highest(policy):
    def called(*seen):
        return call(policy, *seen)

    msr = [
        unload.evaluate(player, 8, 100, position_noise=0.05)["success_rate"].mean()
        for player in (called, policies.highest)
    ]
    return msr[0] > msr[1] + 0.03 or f"its MSR is {msr[0]:.1%}, that of `highest` {msr[1]:.1%}"


EXERCISES = {
    "1": Exercise(number, lambda msr: 0 <= msr < 0.05, "extractor.weight[:, 2] reads z"),
    "2": Exercise(
        number,
        lambda height: abs(height - 0.17 * 1.25 / 2) < 0.02,
        "a step goes half a width to the side and one height up",
    ),
    "3": Exercise(function, beats_highest, ""),
}
