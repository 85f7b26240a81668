"""Ties broken by noise that is drawn anew after each success, and stays after each failure.

The paper says that "the observation vector remains the same" after a failed pick. Noise that goes
on at every pick contradicts this; noise that goes on while boxes leave does not.
"""

from collections.abc import Sequence

import numpy as np

from studies.ties.noise import DriftingTies
from unload import task
from unload.agent.training import Training


def renewed(run: Training, correlation: Sequence[float] = (0.0, 0.0, 0.0)) -> None:
    """Let ties be broken by noise that lasts until a success, in choosing and in learning alike.

    Args:
        run: see ``drifting``, with γ = 0. What its containers show is kept in ``seen``,
            (num_envs, 128, 3) float32, and whether their last pick has failed in ``failed``,
            (num_envs,) bool; both are parts of its state.
        correlation: ρ along x, y and z from one success to the next; 0 draws the noise anew.
    """
    ties, num_envs = DriftingTies(run, correlation), run.config.num_envs
    choose, add = run.agent.choose, run.replay.add
    run.kept["seen"] = np.zeros((num_envs, task.N_VISIBLE, 3), np.float32)
    run.kept["failed"] = np.zeros(num_envs, bool)

    def choose_by_ties(observations: np.ndarray, *rest) -> np.ndarray:
        refilled = run.rollout.steps % run.config.max_picks == 0
        same = run.kept["failed"] & (not refilled)
        before = ties.offsets[same]
        fresh = ties.observations()
        ties.offsets[same] = before
        run.kept["seen"] = np.where(same[:, None, None], run.kept["seen"], fresh)
        return choose(run.kept["seen"], *rest)

    def add_as_seen(observations: np.ndarray, rewards: np.ndarray, **rest) -> None:
        run.kept["failed"] = rewards <= 0
        add(observations=run.kept["seen"], rewards=rewards, **rest)

    run.agent.choose, run.replay.add = choose_by_ties, add_as_seen
