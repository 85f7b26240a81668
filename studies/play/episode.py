"""Picks on one load, one after the other, that can be taken back; and players that make them."""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from unload import task
from unload.agent import policies
from unload.agent.evaluation import Policy
from unload.agent.greedy import load_policy
from unload.env.container import ContainerEnv
from unload.load.boxes import Load
from unload.physics.situation import Surroundings
from unload.physics.table import TablePhysics, shared_table
from unload.support import checks

RULES = {"random": policies.random, "nearest": policies.nearest, "highest": policies.highest}
# Four runs trained the paper's configuration; they differ in their seed only.
AGENTS = {
    "the paper's agent": "paper",
    "the paper's agent, seed 3": "paper_seed_3",
    "the recommended agent": "recommended",
}
PLAYERS = (*RULES, *AGENTS)


class Pick(NamedTuple):
    """One pick and its outcome.

    Attributes:
        item: the picked item.
        distance: how far it moved, in m.
        success: whether that was far enough, so that it is unloaded.
        on_top: the items that rested on it, directly or over others.
        deadlocked: whether it had failed before since the last success.
    """

    item: int
    distance: float
    success: bool
    on_top: tuple[int, ...]
    deadlocked: bool


@dataclass(frozen=True, eq=False)
class Moment:
    """The container between two picks.

    Attributes:
        present: (n,) bool, which items are in it.
        visible: (k,) int64, the up to 128 items that may be picked, nearest first.
        failed: (j,) int64, items that failed since the last success.
        pick: the last pick, None before the first.
    """

    present: np.ndarray
    visible: np.ndarray
    failed: np.ndarray
    pick: Pick | None

    def groups(self) -> dict[str, np.ndarray]:
        """Items by the names of ``unload.drawing.picture.COLOURS``, the later name holds."""
        groups = {"visible": self.visible, "tried": self.failed}
        if self.pick is not None and not self.pick.success:
            groups["failed"] = np.array([self.pick.item])
        return groups


class Episode:
    """Picks on one load, one after the other, that can be taken back.

    Args:
        load: the items; if None, one that the seed draws.
        seed: of the noise of their observed positions, see ``ContainerEnv``.

    Attributes:
        load: the items.
        picks: those made so far, ``Pick`` each.
    """

    def __init__(self, load: Load | None, seed: int) -> None:
        self._env = ContainerEnv("table", max_picks=sys.maxsize)
        self._options = {} if load is None else {"load": load}
        self._seed = seed
        self._begin()
        self.load = self._env.load

    def _begin(self) -> None:
        self._now = self._env.reset(seed=self._seed, options=self._options)
        self.picks: list[Pick] = []
        self._moments: list[Moment] = []
        self._remember(None)

    def _remember(self, pick: Pick | None) -> None:
        """Keep the moment after a pick."""
        visible = self.visible
        failed = np.sort(visible[self.allowed()[: len(visible)] == 0])
        self._moments.append(Moment(self._env.present, visible, failed, pick))

    @property
    def observation(self) -> np.ndarray:
        """(128, 3) float32, what the agent sees."""
        return self._now[0]

    @property
    def visible(self) -> np.ndarray:
        """(k,) int64, the items that may be picked, nearest first."""
        return self._env.visible[self._env.visible >= 0]

    def observed_positions(self) -> np.ndarray:
        """(n, 3) float64, where all items of the load are seen to be, in m."""
        return self._env.observed_positions()

    def allowed(self, mask: bool = True) -> np.ndarray:
        """(128,) int8, 0 in rows without an item and, with the mask, of failed items."""
        return self._now[1]["action_mask" if mask else "item_mask"]

    def pick(self, item: int) -> Pick:
        """Lift a visible item."""
        row = self._env.visible.tolist().index(item)
        on_top = tuple(Surroundings(self.load, self._env.present).on_top(item))
        deadlocked = bool(self.allowed()[row] == 0)
        observation, reward, _, _, info = self._env.step(row)
        self._now = observation, info
        self.picks.append(Pick(item, info["distance"], reward > 0, on_top, deadlocked))
        self._remember(self.picks[-1])
        return self.picks[-1]

    def back_to(self, count: int) -> None:
        """Take back all picks but the first ``count``, which are made again."""
        made = self.picks[:count]
        self._begin()
        for pick in made:
            self.pick(pick.item)

    def moment(self, count: int | None = None) -> Moment:
        """The container after the first ``count`` picks; after all of them if None."""
        return self._moments[-1 if count is None else count]

    def liftable(self, count: int | None = None) -> np.ndarray:
        """(k,) int64, the visible items that could be unloaded after the first ``count`` picks."""
        moment, physics = self.moment(count), TablePhysics(shared_table())
        here = self.load, moment.present
        moved = np.array([physics.lift(*here, item) for item in moment.visible])
        return moment.visible[moved >= task.LIFT_THRESHOLD]

    def unloaded(self, count: int | None = None) -> int:
        """Number of items unloaded by the first ``count`` picks; by all of them if None."""
        return sum(pick.success for pick in self.picks[:count])


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
        player: one of ``PLAYERS``, or a policy, see ``unload.policies``.
        load, seed: see ``Episode``; the seed is also that of random picks.
        mask: whether items that failed since the last success are excluded.

    Attributes:
        mask: as given; may be set anew between picks.
    """

    def __init__(
        self, player: str | Policy, load: Load | None, seed: int, mask: bool = True
    ) -> None:
        self._policy = player if callable(player) else policy_of(player)
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


def explain(pick: Pick) -> str:
    """Say in a sentence how a pick ended, and why."""
    moved = f"Item {pick.item} moved by {_length(pick.distance)}"
    resting = _boxes(len(pick.on_top))
    if pick.success and not pick.on_top:
        return f"{moved}, because nothing rests on it: it is unloaded."
    if pick.success:
        return f"{moved}: {resting} on it, but tipped aside. It is unloaded."
    reason = f"because {resting} on it" if pick.on_top else "although nothing rests on it"
    again = "" if not pick.deadlocked else (
        " It had failed before, and nothing has changed since: this is a deadlock."
    )  # fmt: skip
    threshold = _length(task.LIFT_THRESHOLD)
    return f"{moved}, {reason}: less than {threshold}, therefore the pick failed.{again}"


def _length(metres: float) -> str:
    return f"{metres:.2f} m" if metres >= 0.1 else f"{1000 * metres:.0f} mm"


def _boxes(count: int) -> str:
    return "1 box rests" if count == 1 else f"{count} boxes rest"
