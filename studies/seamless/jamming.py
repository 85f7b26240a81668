"""Jams in a ``Training``: a free box that is picked stays where it is, with some probability.

Whether a box jams is a function of the run's seed and of what it stands in, not of a generator's
state, so that a resumed run goes on with the same jams.
"""

import numpy as np

from unload import task
from unload.agent.training import Training
from unload.fast import containers
from unload.load.boxes import BESIDE, CONTACT_TOLERANCE

# The mixing constants of SplitMix64, which makes well-distributed numbers of counters.
STEP, FIRST, SECOND = (
    np.uint64(0x9E3779B97F4A7C15),
    np.uint64(0xBF58476D1CE4E5B9),
    np.uint64(0x94D049BB133111EB),
)


def uniform(*counters: np.ndarray | int) -> np.ndarray:
    """Numbers in [0, 1) that are a function of whole numbers >= 0, which are broadcast."""
    mixed = np.zeros(np.broadcast(*counters).shape, np.uint64)
    with np.errstate(over="ignore"):  # arithmetic modulo 2^64 is meant
        for counter in counters:
            mixed = (mixed + np.asarray(counter).astype(np.uint64) + np.uint64(1)) * STEP
            mixed = (mixed ^ (mixed >> np.uint64(30))) * FIRST
            mixed = (mixed ^ (mixed >> np.uint64(27))) * SECOND
            mixed = mixed ^ (mixed >> np.uint64(31))
    return (mixed >> np.uint64(11)) / 2.0**53


def jam(run: Training, share: float, lasts: int = 0) -> None:
    """Let a share of the free boxes jam.

    Args:
        run: in containers with loads.
        share: j, of the boxes that a lift would unload; or (num_envs,) float64, one for the box
            that is picked in each container, read at each attempt.
        lasts: successful picks of its container after which it is drawn again whether a box jams;
            each box has a moment of its own in that period. 1: until the next success. 0: it is
            drawn anew at each attempt.
    """
    envs, seed = run.rollout.envs.unwrapped, run.config.seed
    lift, rows = envs._lift, np.arange(run.config.num_envs)

    def lift_jammed(actions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        state, masks = envs._containers, envs._containers.masks.copy()
        state.masks[:] = 1  # a masked row would give the distance of its last attempt
        items, distances = lift(actions)
        state.masks[:] = masks
        if lasts:
            episode = run.rollout.steps // run.config.max_picks
            moment = np.floor(uniform(seed, episode, rows, items, 0) * lasts).astype(np.int64)
            period = (state.unloaded + moment) // lasts
            drawn = uniform(seed, episode, rows, items, 1 + period)
        else:
            drawn = uniform(seed, run.rollout.steps, rows, items)
        distances[(distances >= task.LIFT_THRESHOLD) & (drawn < share)] = 0.0
        return items, distances

    envs._lift = lift_jammed


def jam_by_place(run: Training, shares: np.ndarray, lasts: int) -> None:
    """Let free boxes jam as often as was measured where they stand.

    Args:
        run: as in ``jam``.
        shares: (2, 4) float64, by whether a box stands in front, and by the number of boxes that
            touch the sides (3 or more are one).
        lasts: as in ``jam``; in between a jam ends where the box has lost its neighbours.
    """
    envs = run.rollout.envs.unwrapped
    share = np.zeros(run.config.num_envs)
    jam(run, share, lasts)
    lift, rows = envs._lift, np.arange(len(share))

    def lift_in_place(actions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        items = np.maximum(envs._containers.visible[rows, actions], 0)  # -1 is nobody
        covered, beside = neighbours(envs._containers, items)
        share[:] = np.asarray(shares)[covered, np.minimum(beside, 3)]
        return lift(actions)

    envs._lift = lift_in_place


def neighbours(state: containers.Containers, items: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The present boxes that touch an item in each container.

    Args:
        state: of the containers.
        items: (num_envs,) int64.

    Returns:
        (num_envs,) int64, 1 if one touches the face towards the door, otherwise 0; and (num_envs,)
        int64, how many touch the two faces along y.
    """
    rows = np.arange(len(items))
    present, own = state.present.astype(bool), state.geometry[rows, items]
    # Few boxes begin at the depth where this one ends; only their other sides are looked at.
    begin = state.geometry[..., 0] - state.geometry[..., 3] / 2
    end = own[:, 0] + own[:, 3] / 2
    envs, boxes = np.nonzero(present & (np.abs(begin - end[:, None]) <= CONTACT_TOLERANCE))
    front = state.geometry[envs, boxes]
    apart = np.abs(front[:, 1:3] - own[envs, 1:3])
    reach = (front[:, 4:] + own[envs, 4:]) / 2
    covered = np.zeros(len(items), np.int64)
    covered[envs[(apart < reach - CONTACT_TOLERANCE).all(axis=1)]] = 1

    first, stop = state.starts[rows, BESIDE, items], state.starts[rows, BESIDE, items + 1]
    places = first[:, None] + np.arange((stop - first).max(initial=0))
    listed = places < stop[:, None]
    others = state.links[rows[:, None], np.where(listed, places, 0)]
    beside = listed & present[rows[:, None], others]
    return covered, beside.sum(axis=1)


def weigh(run: Training, z: float) -> None:
    """Let the distance to the viewpoint weigh z otherwise than the paper's W does (Sec. III-B).

    Args:
        run: in containers with loads, which are filled again.
        z: the last entry of W's diagonal; 4 in the paper.
    """
    envs = run.rollout.envs.unwrapped
    weights, show = task.DISTANCE_WEIGHTS * [1, 1, z / task.DISTANCE_WEIGHTS[2]], envs._show

    def show_in_order(env: int, items: np.ndarray, positions: np.ndarray, load) -> None:
        show(env, items, positions, load)
        distances = (task.VIEWPOINT - positions) ** 2 @ weights
        order = np.argsort(distances, kind="stable")
        envs._containers.by_distance[env, : len(load)] = order
        containers.show_nearest(envs._containers, env, *envs._how_observed)

    envs._show = show_in_order
    run.rollout._observe(*envs.reset(seed=run.config.seeds()[0]))
