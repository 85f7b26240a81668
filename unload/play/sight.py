"""What an agent sees, and what it would pick: with blur, ties and exploration as one likes."""

from typing import NamedTuple

import numpy as np

from unload.agent.greedy import Greedy, greedy_actions
from unload.env.equalization import equalize
from unload.env.observation import scaled
from unload.support import checks


class Sight(NamedTuple):
    """What an agent sees of k items, and what it would pick.

    Attributes:
        ranks: (k, 3) float64, of each item along x, y and z, from 0 to k - 1.
        greedy: the row of the item with the highest value.
        chance: probability that the next pick succeeds, exploration included.
    """

    ranks: np.ndarray
    greedy: int
    chance: float


def look(seen: np.ndarray, liftable: np.ndarray, agent: Greedy, epsilon: float, ties: str) -> Sight:
    """Let an agent look at the visible items.

    Args:
        seen: (k, 3) float64, where their centres are seen to be, in m.
        liftable: (k,) bool, which of them can be unloaded.
        agent: the policy; ``ties`` stands in for its own.
        epsilon: probability of a random pick.
        ties: see ``unload.equalize``.

    Raises:
        TypeError, ValueError: an argument is not as described.
    """
    seen = scaled(checks.finite_array("seen", seen, (None, 3)))
    liftable = checks.flag_array("liftable", liftable, (len(seen),))
    epsilon = checks.real("epsilon", epsilon, 0, 1)
    equalized = equalize(seen, ties)
    features = equalized if agent.equalize else seen
    everything = np.ones((1, len(seen)), bool)
    greedy = int(greedy_actions(agent.network, features[None], everything)[0])
    chance = (1 - epsilon) * liftable[greedy] + epsilon * liftable.mean()
    ranks = (equalized.astype(np.float64) + 1) / 2 * (len(seen) - 1)
    return Sight(np.rint(2 * ranks) / 2, greedy, float(chance))  # means of ranks are halves
