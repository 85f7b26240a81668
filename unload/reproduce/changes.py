"""What is changed in a control run of the plan, to learn why runs fall (``data/answer/PLAN.md``).

Each change is a function that alters a ``Training``; ``interventions`` makes them and goes on.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from unload import task
from unload.agent.kept import KeptPicks, random_picks
from unload.agent.replay import ReplayBuffer
from unload.agent.training import Training
from unload.env import observation
from unload.load.boxes import Load
from unload.load.substacks import stack_load
from unload.physics.base import Physics
from unload.physics.choose import make_physics

MEMORY = 2**23  # picks of the enlarged replay
MOST_LOST = 400  # boxes of a replaced container
EXPLORATION = 0.05
FEW = 16  # where few failures are kept, they are one pick in so many of the replay
ADAM_EPSILON = 1.5e-4  # of Rainbow (Hessel et al. 2018)
SLOWER = 10  # divisor of the learning rate
ROWS_AT_ONCE = 2**14  # picks that are moved together


def _nothing(run: Training) -> None:
    """The control."""


def _larger_memory(run: Training) -> None:
    run.replay = moved(run.replay, ReplayBuffer(MEMORY, task.N_VISIBLE, equalized=True))


def _refilled(run: Training) -> None:
    """Once: the next picks overwrite the failures as they overwrite other picks."""
    count = len(run.replay)
    slots = run.rng.permutation(count)[: count // 2]
    filled = 0
    for batch in random_picks(run.config, count // 2, run.rng):
        more = len(batch["rewards"])
        run.replay.overwrite(slots[filled : filled + more], **batch)
        filled += more


def _kept_failures(run: Training) -> None:
    """For good: the next picks overwrite those of the other half only."""
    _keep(run, run.replay.size // 2, succeeded=False)


def _few_kept_failures(run: Training) -> None:
    """The same in a sixteenth of the replay."""
    _keep(run, run.replay.size // FEW, succeeded=False)


def _kept_successes(run: Training) -> None:
    """As many, of picks that teach nothing about failures."""
    _keep(run, run.replay.size // 2, succeeded=True)


def _all_called_failures(run: Training) -> None:
    """As many, of all random picks, each with the reward of a failure."""
    _keep(run, run.replay.size // 2, succeeded=None)
    run.replay.arrays["rewards"][run.replay.size :] = -1


def _successes_called_failures(run: Training) -> None:
    """As many, of successful picks, each with the reward of a failure: none of them is true."""
    _kept_successes(run)
    run.replay.arrays["rewards"][run.replay.size :] = -1


def _keep(run: Training, count: int, succeeded: bool | None) -> None:
    old = run.replay
    kept = random_picks(run.config, count, run.rng, succeeded)
    new = KeptPicks(old.size, task.N_VISIBLE, count, kept, equalized=old.equalized)
    run.replay = moved(old, new)


def _replaced_containers(run: Training) -> None:
    # Ranks of fewer than 128 items do not fit into bytes.
    run.replay = moved(run.replay, ReplayBuffer(run.replay.size, task.N_VISIBLE))
    run.rollout.envs.stack = partly_unloaded  # of the next episodes


def _exploration(run: Training) -> None:
    run.config = replace(run.config, epsilon_final=EXPLORATION)


def _slower_learning(run: Training) -> None:
    run.agent.learner.optimizer.learning_rate /= SLOWER


def _larger_adam_epsilon(run: Training) -> None:
    run.agent.learner.optimizer.epsilon = ADAM_EPSILON


def _ties_averaged(run: Training) -> None:
    run.config = replace(run.config, ties="average")
    run.rollout.reopen(run.config)


# Name → what it changes in a run.
CHANGES: dict[str, Callable[[Training], None]] = {
    "nothing": _nothing,
    "memory_23": _larger_memory,
    "failures_refilled": _refilled,
    "failures_kept": _kept_failures,
    "few_failures_kept": _few_kept_failures,
    "successes_kept": _kept_successes,
    "all_called_failures": _all_called_failures,
    "successes_called_failures": _successes_called_failures,
    "containers_replaced": _replaced_containers,
    "exploration_held": _exploration,
    "learning_rate_lowered": _slower_learning,
    "adam_epsilon_raised": _larger_adam_epsilon,
    "ties_averaged": _ties_averaged,
}


def moved(replay: ReplayBuffer, empty: ReplayBuffer) -> ReplayBuffer:
    """Move the picks of a memory, the oldest first, to an empty one; return that.

    If it has less room, the latest picks are in it then.

    Raises:
        ValueError: a part of the memory is kept for good and has no place in that order.
    """
    if isinstance(replay, KeptPicks):
        raise ValueError("replay keeps picks for good; expected a plain ReplayBuffer to move")
    rows = np.arange(replay.total - len(replay), replay.total) % replay.size
    for part in np.array_split(rows, len(rows) // ROWS_AT_ONCE + 1):
        empty.add(**replay.rows(part))
    return empty


def partly_unloaded(rng: np.random.Generator) -> Load:
    """A random load that has lost 0 to 400 boxes to a random policy."""
    load, lost = stack_load(rng), int(rng.integers(MOST_LOST + 1))
    physics = _physics()
    physics.reset(load)
    left = observation.nearest(load.positions, len(load)).tolist()
    for _ in range(lost):
        # Each of the nearest boxes until one can be lifted, because a failure changes nothing.
        for place in rng.permutation(min(len(left), task.N_VISIBLE)).tolist():
            if physics.lift(left[place]) >= task.LIFT_THRESHOLD:
                physics.remove(left.pop(place))
                break
    kept = physics.present
    return Load(load.positions[kept], load.sizes[kept], load.packages[kept], load.walls[kept])


@cache
def _physics() -> Physics:
    return make_physics("table", "restore")
