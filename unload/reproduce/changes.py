"""Changes of a ``Training`` that several experiments make, see ``train_changed``.

Each is made before the first pick, and depends on the pick alone, so that a resumed run stays the
same.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from unload.agent.training import Training
from unload.support import checks


def height_reward(share: float) -> Callable[[Training], None]:
    """Return the change that makes a failed pick the less bad, the higher its item (Sec. V-A).

    Args:
        share: h, in [0, 1]. A failed pick is learned from as -1 + h (z + 1) / 2, z as observed;
            the learning curve keeps the rewards of the environment.
    """
    return partial(_shape_rewards, share=checks.real("share", share, 0, 1))


def _shape_rewards(run: Training, share: float) -> None:
    add = run.replay.add

    def add_shaped(
        observations: np.ndarray, actions: np.ndarray, rewards: np.ndarray, **rest: np.ndarray
    ) -> None:
        heights = (observations[np.arange(len(actions)), actions, 2] + 1) / 2  # in [0, 1]
        shaped = np.where(rewards < 0, rewards + share * heights, rewards)
        add(observations=observations, actions=actions, rewards=shaped, **rest)

    run.replay.add = add_shaped
