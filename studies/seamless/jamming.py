"""Jams in a ``Training``: a free box that is picked stays where it is, with some probability.

Whether a box jams is a function of the run's seed and of what it stands in, not of a generator's
state, so that a resumed run goes on with the same jams.
"""

from collections.abc import Callable

import numpy as np

from unload import task
from unload.agent.training import Training
from unload.fast import containers

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
        share: j, of the boxes that a lift would unload.
        lasts: successful picks of its container after which it is drawn again whether a box jams;
            each box has a moment of its own in that period. 1: until the next success. 0: it is
            drawn anew at each attempt.
    """
    envs, seed = run.rollout.envs.unwrapped, run.config.seed
    look_up, rows = envs._look_up, np.arange(run.config.num_envs)

    def look_up_jammed(actions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        state, masks = envs._containers, envs._containers.masks.copy()
        state.masks[:] = 1  # a masked row would give the distance of its last attempt
        items, distances = look_up(actions)
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

    envs._look_up = look_up_jammed


def weigh(run: Training, z: float, change: Callable[[Training], None] | None = None) -> None:
    """Let the distance to the viewpoint weigh z otherwise than the paper's W does (Sec. III-B).

    Args:
        run: in containers with loads, which are filled again.
        z: the last entry of W's diagonal; 4 in the paper.
        change: another one that is made, too.
    """
    envs = run.rollout.envs.unwrapped
    weights, put = task.DISTANCE_WEIGHTS * [1, 1, z / task.DISTANCE_WEIGHTS[2]], envs._put

    def put_in_order(env: int, load, blur: np.ndarray) -> None:
        put(env, load, blur)
        distances = (task.VIEWPOINT - load.positions - blur) ** 2 @ weights
        order = np.argsort(distances, kind="stable")
        envs._containers.by_distance[env, : len(load)] = order
        containers.start(envs._containers, env, *envs._features)

    envs._put = put_in_order
    run.rollout._see(*envs.reset(seed=run.config.seeds()[0]))
    if change is not None:
        change(run)
