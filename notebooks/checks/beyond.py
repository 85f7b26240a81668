"""The exercises beyond the paper, notebooks 20 to 22, that have an answer to check."""

from importlib.util import find_spec

import numpy as np

import unload
from notebooks.checks import Exercise, NotHere, call, function, number, pair
from studies.heap.env import HeapEnv
from studies.heap.policies import RULES, play
from studies.heap.table import best_rule
from studies.results import read_table
from unload import policies

# Notebook 20


def beats_highest(policy):
    def called(*seen):
        return call(policy, *seen)

    msr = [
        unload.evaluate(player, 8, 100, position_noise=0.05)["success_rate"].mean()
        for player in (called, policies.highest)
    ]
    return msr[0] > msr[1] + 0.03 or f"its MSR is {msr[0]:.1%}, that of `highest` {msr[1]:.1%}"


# Notebook 21


def luckiest(value):
    """Whether it is the difference, as exactly as the printed tables give it."""
    rules, table = read_table("heap/rules"), read_table("heap/table")
    on_training = rules.set_index("rule").loc[best_rule(rules, 1.0)]
    unseen = table.query("policy == 'best rule' and falls_weight == 1")["net"].item()
    return abs(value - (on_training["boxes"] - on_training["falls"] - unseen)) < 0.02


def brings_more(rule):
    """Whether a rule unloads 0.2 boxes a pick more than "highest" on three training heaps.

    MuJoCo cannot stand in: of the boxes of these heaps, at rest in PyBullet, it moves 10 to 39 by
    more than 2 cm within half a second, without any pick.
    """
    if find_spec("pybullet") is None:
        said = "heaps are simulated by PyBullet, which there is for Python 3.11 on Linux x86-64"
        raise NotHere(f"{said}; the solutions show what a right answer gives")

    def called(*seen):
        return call(rule, *seen)

    env, means = HeapEnv("train", physics="coarse"), []
    for player in (called, RULES["highest"]):
        played = [play(env, player, heap, 0).unloaded.mean() for heap in env.heaps[:3]]
        means.append(np.mean(played))
    env.close()
    if means[0] < means[1] + 0.2:
        return f"it unloads {means[0]:.2f} boxes a pick, `highest` {means[1]:.2f}"
    return True


def wider(value):
    played = read_table("heap/episodes").query("falls_weight == 1")
    net = played.pivot(index="heap", columns="policy", values="net")
    one, other = net["learned"], net["best rule"]
    return abs(value - (one.var() + other.var()) ** 0.5 / (one - other).std()) < 0.05


EXERCISES = {
    "20/1": Exercise(
        number,
        lambda msr: 0 <= msr < 0.05,
        "extractor.weight[:, 2] reads z; evaluate with mask=False",
    ),
    "20/2": Exercise(
        number,
        lambda height: abs(height - 0.17 * 1.25 / 2) < 0.02,
        "a step goes half a width to the side and one height up",
    ),
    "20/3": Exercise(function, beats_highest, ""),
    "21/1": Exercise(
        number, luckiest, "section 3 has the training heaps, section 5 the unseen ones"
    ),
    "21/2": Exercise(function, brings_more, ""),
    "21/3": Exercise(number, wider, "variances of independent numbers add up"),
    "22/1": Exercise(pair, lambda kept: kept == (16 * 16, 128 * 16), "see section 4"),
    "22/2": Exercise(
        number,
        lambda rate: abs(rate * (0.1 * 0.013 + 0.9 * 0.00001) - 1) < 0.02,
        "what adds up is the time of the lifts, not their speed",
    ),
}
