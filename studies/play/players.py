"""The players of the playground: rules, and agents whose weights are stored."""

from collections.abc import Callable
from functools import cache

import numpy as np

from studies.play.episode import Episode
from unload.agent import policies
from unload.agent.greedy import load_policy
from unload.load.boxes import Load
from unload.support import checks

RULES = {"random": policies.random, "nearest": policies.nearest, "highest": policies.highest}
# Four runs trained the paper's configuration; they differ in their seed only.
AGENTS = {
    "the paper's agent": "paper",
    "the paper's agent, seed 3": "paper_seed_3",
    "the recommended agent": "recommended",
}
PLAYERS = (*RULES, *AGENTS)


@cache
def policy_of(player: str) -> Callable:
    """The policy of a player, see ``unload.policies``."""
    checks.one_of("player", player, PLAYERS)
    if player in RULES:
        return RULES[player]
    return load_policy(AGENTS[player])


class Run(Episode):
    """A player's picks on a load, made as far as they are needed.

    Args:
        player: one of ``PLAYERS``.
        load, seed: see ``Episode``; the seed is also that of random picks.
        mask: whether items that failed since the last success are excluded.

    Attributes:
        mask: as given; may be set anew between picks.
    """

    def __init__(self, player: str, load: Load, seed: int = 0, mask: bool = True) -> None:
        self._policy = policy_of(player)
        self.mask = mask
        super().__init__(load, seed)

    def play_to(self, count: int) -> int:
        """Pick until there are ``count`` picks; return how many there are.

        They are fewer if the container is empty before, or all visible items have failed.
        """
        while len(self.picks) < count and self.allowed(self.mask).any():
            self.pick(self.choose())
        return min(count, len(self.picks))

    def choose(self) -> int:
        """Return the item that the player picks next.

        The random numbers depend on the seed and the number of picks alone, so that
        going back changes nothing.
        """
        rng = np.random.default_rng([self._seed, len(self.picks)])
        allowed = self.allowed(self.mask)
        row = self._policy(self.observation[None], allowed[None], rng)[0]
        return int(self.visible[row])
