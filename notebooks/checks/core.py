"""The exercises of the core, notebooks 00 to 06; those of 04 stand in ``masked_dqn``."""

from itertools import pairwise

import numpy as np
import torch

import unload
from notebooks.checks import Exercise, Unusable, call, function, masked_dqn, number, numbers, pair
from studies.falls import measures
from studies.falls.laboratory import taught_preference
from studies.play.episode import Run
from unload import PEQNetwork, task
from unload.physics.table import TablePhysics, shared_table

# Notebook 00


LOADS = 20


def runs(player, picks, **options):
    """A player's runs on some loads."""
    played = []
    for seed in range(LOADS):
        run = Run(player, unload.stack_load(np.random.default_rng(seed)), seed, **options)
        run.play_to(picks)
        played.append(run)
    return played


def successes(mean):
    expected = np.mean([run.unloaded() for run in runs("random", 50)])
    if abs(mean / LOADS - expected) < 1.5:
        return f"{mean:g} looks like the sum over {LOADS} loads; expected their mean"
    return abs(mean - expected) < 1.5


def deadlocks(loads):
    if not loads.is_integer():
        return f"{loads:g} is not a number of loads; expected one of 0 to {LOADS}"
    played = runs("the paper's agent, seed 3", 100, mask=False)
    return loads == sum(any(pick.deadlocked for pick in run.picks) for run in played)


def actions_of(policy, observations, masks, rng):
    """The actions of a reader's policy.

    Raises:
        Unusable: they are not one for each container.
    """
    actions = np.asarray(call(policy, observations, masks, rng))
    if actions.shape != masks.shape[:1] or actions.dtype.kind not in "iu":
        raise Unusable(
            f"asked about {len(masks)} containers it returns {actions.dtype} of shape "
            f"{actions.shape}; expected an array of {len(masks)} actions, one a container"
        )
    return actions


# Notebook 01

WEIGHTS = 1, 4, 16  # of z, in the slider


def best_weight(weight):
    """The one of the weights of z with which the most of 128 visible items can be lifted."""
    load, physics = unload.stack_load(np.random.default_rng(1)), TablePhysics(shared_table())
    present = np.ones(len(load), bool)

    def share(each):
        distance = np.sqrt((task.VIEWPOINT - load.positions) ** 2 @ np.array([1, 0, each]))
        visible = np.argsort(distance, kind="stable")[:128].tolist()
        moved = np.array([physics.lift(load, present, item) for item in visible])
        return np.mean(moved >= task.LIFT_THRESHOLD)

    return weight == max(WEIGHTS, key=share)


def seldom_succeeds(policy):
    """Whether a policy obeys the masks, and hardly ever succeeds."""
    obeys = []

    def noted(observations, masks, rng):
        actions = actions_of(policy, observations, masks, rng)
        obeys.extend(masks[np.arange(len(actions)), actions] == 1)
        return actions

    msr = unload.evaluate(noted, 2, 1, max_picks=100)["success_rate"].mean()
    return msr < 0.05 if all(obeys) else "it picks boxes that the mask forbids"


# Notebook 02


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
    if changed.shape != values.shape:
        return f"of {len(values)} values it makes an array of shape {changed.shape}"
    if np.allclose(changed, values):
        return "it keeps the order of values, but changes none of them"
    return np.array_equal(unload.equalize(changed[:, None]), unload.equalize(values[:, None]))


def makes_order_the_rank(rows_of):
    """Whether sorting's index is the rank of heights, if rows stand as a function says."""
    heights = np.random.default_rng(0).uniform(-1, 1, 128)
    rows = np.asarray(call(rows_of, heights.copy()))
    if not np.array_equal(np.sort(rows, axis=None), np.arange(len(heights))):
        return (
            f"it returns {np.array2string(rows, threshold=8)}; expected each row from 0 to 127 once"
        )
    index = np.argsort(heights[rows])
    differ = (index != np.argsort(index)).sum()
    return f"index and rank differ in {differ} of 128 rows" if differ else True


# Notebook 03


@torch.no_grad()
def is_the_network(scores):
    """Whether a function computes what the network does, of any number of items and features."""
    for batch, items, n_features in ((1, 128, 64), (3, 5, 8)):
        generator = torch.Generator().manual_seed(items)
        network = PEQNetwork(n_features, generator)
        x = 2 * torch.rand((batch, items, 3), generator=generator) - 1
        extractor, scorer = network.extractor, network.scorer
        got = call(scores, x, extractor.weight, extractor.bias, scorer.weight, scorer.bias)
        if got.shape != (batch, items):
            return f"of x with shape {tuple(x.shape)} it makes {tuple(got.shape)}"
        if not torch.allclose(got, network(x), atol=1e-5):
            away = (got - network(x)).abs().max().item()
            return f"of x with shape {tuple(x.shape)} a score is off by {away:.2g}"
    return True


def third_item_decides(scorer):
    """Whether the third of three items can change which of the others a scorer prefers."""
    rng = np.random.default_rng(0)
    for _ in range(200):
        first, second, *thirds = rng.random(4)
        prefers = set()
        for third in thirds:
            features = np.array([first, second, third])
            scores = np.asarray(call(scorer, features, features.mean()))
            if scores.shape != features.shape:
                return f"of {len(features)} features it makes values of shape {scores.shape}"
            prefers.add(bool(scores[0] > scores[1]))
        if len(prefers) == 2:
            return True
    return False


# Notebook 05


def along_depth(observations, masks, rng):
    """The rule that picks the highest z + x."""
    scores = observations @ np.array([1, 0, 1], np.float32)
    return np.where(masks.astype(bool), scores, -np.inf).argmax(axis=1)


def both(shares):
    found = [
        unload.evaluate(along_depth, 4, 0, equalize=ranks)["success_rate"].mean()
        for ranks in (False, True)
    ]
    if np.allclose(shares, found[::-1], atol=0.02):
        return "both are right, in the wrong order; expected positions first"
    return np.allclose(shares, found, atol=0.02)


def digs_left(rule):
    """Whether a rule never misses in two containers and keeps to the left side."""
    places = []

    def noted(observations, masks, rng):
        actions = actions_of(rule, observations, masks, rng)
        places.extend(observations[np.arange(len(actions)), actions, 1].tolist())
        return actions

    msr = unload.evaluate(noted, 2, 0, max_picks=150)["success_rate"].mean()
    if msr < 1:
        return f"{msr:.1%} of its picks succeed; expected all"
    if np.mean(places) > LEFT:
        return f"the mean y of its picks is {np.mean(places):.2f}; expected {LEFT} or less"
    return True


LEFT = -0.2  # mean y of the picks; -1 is the left side wall


# Notebook 06


def msr(along_x, along_y, ties="noise"):
    policy = measures.preferring(along_x, along_y, ties)
    return unload.evaluate(policy, 2)["success_rate"].mean()


def errs_first(along_y):
    """Whether a rule errs, but not the one of the other side, nor those of a tenth less."""
    less = along_y - np.copysign(0.1, along_y)
    return msr(0, along_y) < 0.95 <= min(msr(0, each) for each in (-along_y, less, -less))


def teach_each_other(preferences):
    if len(preferences) != PUPILS:
        return f"these are {len(preferences)} preferences; expected {PUPILS}"
    for teacher, pupil in pairwise([FIRST_TEACHER, *preferences]):
        if abs(pupil - taught_preference(teacher)) > 1e-3:
            return f"{pupil:.3g} is not what a pupil of the teacher {teacher:.3g} prefers"
    return True


FIRST_TEACHER, PUPILS = 0.1, 4


EXERCISES = {
    "00/1": Exercise(number, successes, "load and run have the same seed, 0 to 19; play to 50"),
    "00/2": Exercise(number, deadlocks, "does each run have mask=False and its load's seed?"),
    "01/1": Exercise(number, best_weight, "move the slider"),
    "01/2": Exercise(
        function, seldom_succeeds, "observations[..., 2] is the height; obey the masks"
    ),
    "02/1": Exercise(function, equalizes, ""),
    "02/2": Exercise(function, leaves_the_ranks, "which functions keep the order of numbers?"),
    "02/3": Exercise(function, makes_order_the_rank, ""),
    "03/1": Exercise(function, is_the_network, ""),
    "03/2": Exercise(number, lambda score: abs(score - 0.9) < 1e-6, "which pooled numbers change?"),
    "03/3": Exercise(
        function,
        third_item_decides,
        "whatever the third item is, it prefers the same one of two; "
        "can it prefer the item that is farthest from the mean?",
    ),
    **masked_dqn.EXERCISES,
    "05/1": Exercise(
        number,
        lambda height: abs(height - 0.3 * 1.25 / 2) < 0.005,
        "a step goes half a width to the side and one height up",
    ),
    "05/2": Exercise(pair, both, "the preference is along x, c = 0: rule(0, 1)"),
    "05/3": Exercise(function, digs_left, ""),
    "06/1": Exercise(number, errs_first, "try both signs; the title of the figure gives the MSR"),
    "06/2": Exercise(numbers, teach_each_other, ""),
}
