"""Episodes: one played, recorded for learning, and the policies that only recording needs."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from unload.heap.boxes import Heap
from unload.heap.env import HeapEnv
from unload.heap.learning import Picks
from unload.heap.observation import COLUMNS, ROWS
from unload.heap.rake import Outcome, Rake
from unload.heap.rules import best, linear, random
from unload.support import checks

TRIED_AGAIN = 8  # boxes, by an oracle
EXPLORED = "z", "behind", "extent_y", "clear_above"  # columns that a random rule weighs


@dataclass(frozen=True, eq=False)
class Episode:
    """What happened in an episode of t picks.

    Attributes:
        observations: (t + 1, 96, 13) float32, the last one after the last pick.
        masks: (t + 1, 96) bool, what could be picked; all False once the heap is empty.
        actions: (t,) int64, dragged rows.
        boxes: (t,) int64, dragged boxes, by their numbers in the heap before each pick.
        unloaded, falls: (t,) int64, of each pick.
        moved: (t,) float64, m, how far the dragged box came.
        fates: (t, 96) int8, what happened to the box in each row, see ``HeapEnv``.
        heaps: t + 1 heaps, before each pick and after the last; () if not kept.
    """

    observations: np.ndarray
    masks: np.ndarray
    actions: np.ndarray
    boxes: np.ndarray
    unloaded: np.ndarray
    falls: np.ndarray
    moved: np.ndarray
    fates: np.ndarray
    heaps: tuple[Heap, ...] = ()

    def arrays(self) -> dict[str, np.ndarray]:
        """The arrays to store, without the rows that never hold a box."""
        rows = max(int(self.masks.any(axis=0).nonzero()[0].max(initial=0)) + 1, 1)
        rows = max(rows, int(self.observations.any(axis=(0, 2)).nonzero()[0].max(initial=0)) + 1)
        stored = {name: getattr(self, name) for name in _STORED}
        return stored | {
            "observations": self.observations[:, :rows],
            "masks": self.masks[:, :rows],
            "fates": self.fates[:, :rows],
        }


_STORED = "actions", "boxes", "unloaded", "falls", "moved"
_TOLD = "box", "unloaded", "falls", "moved", "fates"  # by the environment


def episode_from(arrays: dict[str, np.ndarray]) -> Episode:
    """The episode of which ``Episode.arrays`` were stored."""
    count, rows = arrays["masks"].shape
    observations = np.zeros((count, ROWS, len(COLUMNS)), np.float32)
    observations[:, :rows] = arrays["observations"]
    masks = np.zeros((count, ROWS), bool)
    masks[:, :rows] = arrays["masks"]
    fates = np.zeros((count - 1, ROWS), np.int8)
    fates[:, :rows] = arrays["fates"]
    return Episode(observations, masks, *(arrays[name] for name in _STORED), fates)


def picks_of(episode: Episode) -> Picks:
    """The picks of an episode, as ``fit`` needs them."""
    return Picks(
        episode.observations[:-1],
        episode.actions,
        episode.unloaded.astype(np.float32),
        episode.falls.astype(np.float32),
        episode.observations[1:],
        episode.masks[1:],
        episode.fates,
    )


def play(
    env: HeapEnv, policy: Callable, heap: Heap, seed: int, keep_heaps: bool = False
) -> Episode:
    """Let a policy play a heap until the episode ends.

    Args:
        env: in which it plays.
        policy: see ``unload.heap.rules``.
        heap: to begin with.
        seed: of the policy's random numbers.
        keep_heaps: whether the episode holds the heap before and after every pick.
    """
    rng = np.random.default_rng(checks.integer("seed", seed, 0))
    observation, info = env.reset(options={"heap": heap})
    observations, masks, heaps = [observation], [info["action_mask"]], [env.heap]
    picks, ended = [], False
    while not ended:
        (action,) = policy(observations[-1][None], masks[-1][None], rng)
        observation, _, terminated, truncated, info = env.step(int(action))
        ended = terminated or truncated
        picks.append((action, *(info[name] for name in _TOLD)))
        observations.append(observation)
        masks.append(info["action_mask"])
        heaps.append(env.heap)
    columns = [np.array(column) for column in zip(*picks)]
    return Episode(
        np.array(observations),
        np.array(masks, bool),
        *columns,
        tuple(heaps) if keep_heaps else (),
    )


def outcomes(episode: Episode, rake: Rake) -> list[Outcome]:
    """What each pick of an episode with its heaps has done, box by box.

    It is computed again, which gives the same to the bit, because a pick is a function of the
    heap and the box.

    Args:
        episode: with ``heaps``.
        rake: with the physics of the environment that was played.

    Raises:
        ValueError: the episode does not hold its heaps, or the rake's physics is another.
    """
    if not episode.heaps:
        raise ValueError("episode holds no heaps; expected one played with keep_heaps=True")
    found = []
    for heap, box, after in zip(episode.heaps, episode.boxes.tolist(), episode.heaps[1:]):
        found.append(rake.pick(heap, box))
        if not np.array_equal(found[-1].heap.positions, after.positions):
            raise ValueError(f"rake has other physics than the episode's; it is {rake.physics}")
    return found


def exploring(rng: np.random.Generator, favourite: Callable | None = None) -> Callable:
    """A policy to record: half of its picks are random, because every box must be tried.

    Args:
        rng: draws its favourite.
        favourite: policy of the other half; a linear rule with normally distributed weights
            of ``EXPLORED`` if None, a new one for each call of this function.
    """
    if favourite is None:
        favourite = best(linear({name: rng.normal() for name in EXPLORED}))

    def policy(observations, masks, rng):
        chosen = random if rng.random() < 0.5 else favourite
        return chosen(observations, masks, rng)

    return policy


class Oracle:
    """Policy that tries every allowed box of an environment's heap, and picks the best.

    It is greedy: one that looks farther ahead could gain more in an episode. By its next pick
    no other policy gains more in the physics that it asks, if it asks one. No rule or network
    may know what it knows.

    Args:
        env: whose heap it is.
        falls_weight: λ of what it maximizes, boxes - λ falls.
        physics: that it asks, see ``Rake``; other than the environment's, it may err.
        again: physics in which it tries the ``TRIED_AGAIN`` best of these again, None: not at
            all. With the environment's it does not err about them, but the best box of all
            may not be among them; it takes half of the time of trying all of them in that.
    """

    def __init__(
        self, env: HeapEnv, falls_weight: float, physics: str = "coarse", again: str | None = None
    ) -> None:
        self.env = env
        self.falls_weight = checks.real("falls_weight", falls_weight, 0)
        self._rakes = [Rake(name) for name in (physics, again) if name is not None]

    def __call__(self, observations, masks, rng: np.random.Generator) -> np.ndarray:
        rows = np.flatnonzero(masks[0])
        for rake in self._rakes:
            values = [self._value(rake, row) for row in rows.tolist()]
            rows = rows[np.argsort(np.negative(values), kind="stable")][:TRIED_AGAIN]
        return rows[:1]

    def _value(self, rake: Rake, row: int) -> float:
        outcome = rake.pick(self.env.heap, int(self.env.visible[row]))
        return float(outcome.unloaded.sum() - self.falls_weight * outcome.fallen.sum())

    def close(self) -> None:
        """Disconnect its clients; may be called again."""
        for rake in self._rakes:
            rake.close()
