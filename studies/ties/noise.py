"""Ties broken by noise that goes on while a container is unloaded.

The environments draw the noise of a load once, so that boxes at the same place along an axis keep
their order until one of them is unloaded. In a simulation that goes on, boxes creep, and their
order changes with them. Here each box has an offset on each axis that drifts from pick to pick as a
first-order process: from one pick to the next its correlation is ρ. With ρ = 0 it is drawn anew at
each pick, and with ρ = 1 it is frozen, as it is in the environments.
"""

from collections.abc import Sequence

import numba
import numpy as np

from unload import task
from unload.agent.training import Training
from unload.env.observation import POSITION_NOISE

# Standard deviation of the offsets on each axis in scaled coordinates. Ranks depend on their
# order alone, as long as they are small beside the 3.5 cm between the places of the paper's loads.
SPREAD = 2 * POSITION_NOISE / task.CONTAINER
MOST_ITEMS = 1100  # for which the environments make room, where a load has up to 1,000
LEVELS = ((2 * np.arange(task.N_VISIBLE) - task.N_VISIBLE + 1) / (task.N_VISIBLE - 1)).astype("f4")


class DriftingTies:
    """Equalized observations of a ``Training``, in which drifting offsets break the ties.

    Args:
        run: in containers, with ``equalize`` and with ``position_noise`` 0.
        correlation: ρ of the offsets along x, y and z from one pick to the next.
        name: of the offsets in ``run.kept``, where a run has several.

    Attributes:
        offsets: (num_envs, ``MOST_ITEMS``, 3) float32, of each item in units of ``SPREAD``; a part
            of the run's state.

    Raises:
        ValueError: the run's own noise would be added.
    """

    def __init__(self, run: Training, correlation: Sequence[float], name: str = "ties") -> None:
        config = run.config
        if config.position_noise or not config.equalize:
            raise ValueError(
                f"position_noise is {config.position_noise} and equalize {config.equalize}; "
                "expected 0 and True, because the ties of equalized positions are broken here"
            )
        self._run, self._name = run, name
        self._kept = np.asarray(correlation, np.float32)
        self._drawn = np.sqrt(1 - self._kept**2)
        run.kept[name] = np.zeros((config.num_envs, MOST_ITEMS, 3), np.float32)

    @property
    def offsets(self) -> np.ndarray:
        return self._run.kept[self._name]  # another array in a run that goes on

    def observations(self) -> np.ndarray:
        """Observe the containers after the offsets have moved on by a pick, float32 in [-1, 1].

        What is drawn depends on the seed and the step alone, so that a resumed run goes on alike.
        """
        config, step = self._run.config, self._run.rollout.steps
        state = self._run.rollout.envs.unwrapped._containers
        rng = np.random.default_rng((config.seed, step, 0))
        if step % config.max_picks == 0:  # all containers have just been filled
            room = state.present.shape[1]
            self.offsets[:, :room] = rng.standard_normal((config.num_envs, room, 3), np.float32)
        fresh = rng.standard_normal((config.num_envs, task.N_VISIBLE, 3), np.float32)
        positions = np.empty(state.values.shape)
        _move(self.offsets, state.visible, fresh, self._kept, self._drawn, state.values, positions)
        seen = np.empty((config.num_envs, task.N_VISIBLE, 3), np.float32)
        _write(np.argsort(positions, axis=2), seen)
        return seen


@numba.njit(cache=True)
def _move(offsets, visible, fresh, kept, drawn, values, positions):
    """Move the offsets of the visible items, and fill ``positions`` (envs, axes, rows)."""
    for env in range(visible.shape[0]):
        for row in range(visible.shape[1]):
            item = visible[env, row]
            for axis in range(3):
                offset = kept[axis] * offsets[env, item, axis] + drawn[axis] * fresh[env, row, axis]
                offsets[env, item, axis] = offset
                positions[env, axis, row] = values[env, axis, row] + SPREAD[axis] * offset


@numba.njit(cache=True)
def _write(order, seen):
    """Write the equalized coordinates of rows whose ``order`` (envs, axes, rows) is known."""
    for env in range(order.shape[0]):
        for axis in range(3):
            for rank in range(order.shape[2]):
                seen[env, order[env, axis, rank], axis] = LEVELS[rank]


def drifting(
    run: Training, correlation: Sequence[float], memory: Sequence[float] | None = None
) -> None:
    """Let ties be broken by offsets that drift, in choosing and in learning.

    Args:
        run: see ``DriftingTies``; its containers hold 128 items or more at every pick.
        correlation: ρ along x, y and z.
        memory: of other offsets, which break the ties in the replay memory; what is chosen by is
            learned from if None.
    """
    ties = DriftingTies(run, correlation)
    others = None if memory is None else DriftingTies(run, memory, "ties of the memory")
    choose, add = run.agent.choose, run.replay.add
    seen = np.empty(0)

    def choose_by_ties(observations: np.ndarray, *rest) -> np.ndarray:
        nonlocal seen
        chosen = ties.observations()
        seen = chosen if others is None else others.observations()
        return choose(chosen, *rest)

    run.agent.choose = choose_by_ties
    run.replay.add = lambda observations, **rest: add(observations=seen, **rest)
