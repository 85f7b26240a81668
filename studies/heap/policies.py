"""Picking rules that need no learning, an oracle, and the episodes that policies play.

Policies are functions ``policy(observations, masks, rng) -> actions`` on a batch, as in
``unload.policies``: observations (batch, 96, 13) float as ``HeapEnv`` gives them, masks
(batch, 96). A rule scores each visible box, and the allowed box of the highest score is picked.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from studies.heap.boxes import Heap
from studies.heap.env import HeapEnv
from studies.heap.observation import COLUMN, COLUMNS, EYE
from studies.heap.rake import Outcome, Rake
from unload.agent.policies import any_allowed
from unload.support import checks

Score = Callable[[np.ndarray], np.ndarray]  # (batch, 96, 13) → (batch, 96)
TRIED_AGAIN = 8  # boxes, by an oracle


def best(score: Score) -> Callable:
    """The policy that picks the allowed box with the highest score, the foremost if several."""

    def policy(observations, masks, rng):
        return np.where(masks, score(np.asarray(observations, float)), -np.inf).argmax(axis=1)

    return policy


def linear(weights: Mapping[str, float]) -> Score:
    """The score that is a weighted sum of columns of the observation."""
    for name in weights:
        checks.one_of("a column", name, COLUMNS)
    vector = np.array([weights.get(name, 0.0) for name in COLUMNS])
    return lambda observations: observations @ vector


def _nearness(observations: np.ndarray) -> np.ndarray:
    """Minus the squared distance from the camera, as if the foremost face stood at the door."""
    place = observations[..., [COLUMN["behind"], COLUMN["y"], COLUMN["z"]]]
    return -((place - (-2.0, 0.0, EYE[2])) ** 2).sum(axis=-1)


def _clear_above(observations: np.ndarray) -> np.ndarray:
    """The foremost box among those of which at most a tenth is covered."""
    clear = observations[..., COLUMN["clear_above"]] >= 0.9
    return 10 * clear - observations[..., COLUMN["behind"]]


RULES = {
    "random": lambda observations, masks, rng: any_allowed(masks, rng),
    "highest": best(linear({"z": 1})),
    "nearest": best(_nearness),
    "lowest": best(linear({"z": -1})),
    "foremost": best(linear({"behind": -1})),
    "clear above": best(_clear_above),
}


class Oracle:
    """Policy that tries every allowed box of an environment's heap, and picks the best.

    It tries all of them in the coarse physics, and the ``TRIED_AGAIN`` best ones again in the
    physics of the environment, in which it does not err about them; but the best box of all may
    not be among them. It is greedy: one that looks farther ahead could gain more in an episode.
    No rule or network may know what it knows.

    Args:
        env: whose heap it is.
        falls_weight: λ of what it maximizes, boxes - λ falls.
    """

    def __init__(self, env: HeapEnv, falls_weight: float) -> None:
        self.env, self.falls_weight = env, falls_weight
        self._rakes = [Rake("coarse"), env._rake]

    def __call__(self, observations, masks, rng: np.random.Generator) -> np.ndarray:
        rows = np.flatnonzero(masks[0])
        for rake in self._rakes:
            values = [self._value(rake, row) for row in rows.tolist()]
            rows = rows[np.argsort(np.negative(values), kind="stable")][:TRIED_AGAIN]
        return rows[:1]

    def _value(self, rake: Rake, row: int) -> float:
        outcome = rake.pick(self.env.heap, int(self.env.visible[row]))
        return float(outcome.unloaded.sum() - self.falls_weight * outcome.fallen.sum())


@dataclass(frozen=True, eq=False)
class Picks:
    """Recorded picks.

    Attributes:
        observations: (n, 96, 13) float32, before each pick.
        actions: (n,) int64, the rows that were dragged.
        unloaded, falls: (n,) int64, of each pick.
        fates: (n, 96) int8, what happened to the box in each row, see ``HeapEnv``.
    """

    observations: np.ndarray
    actions: np.ndarray
    unloaded: np.ndarray
    falls: np.ndarray
    fates: np.ndarray

    def __len__(self) -> int:
        return len(self.actions)


@dataclass(frozen=True, eq=False)
class Episode(Picks):
    """The picks of an episode, one after the other.

    Attributes:
        boxes: (n,) int64, dragged boxes, by their numbers in the heap before each pick.
        heaps: n + 1 heaps, before each pick and after the last.
        outcomes: n, what each pick has done, box by box.
    """

    boxes: np.ndarray
    heaps: tuple[Heap, ...]
    outcomes: tuple[Outcome, ...]


_TOLD = "unloaded", "falls", "fates", "box"  # by the environment, as in ``Episode``


def play(env: HeapEnv, policy: Callable, heap: Heap, seed: int) -> Episode:
    """Let a policy play a heap until the episode ends; the seed is of its random numbers."""
    rng = np.random.default_rng(seed)
    observation, info = env.reset(options={"heap": heap})
    picks, heaps, outcomes, ended = [], [env.heap], [], False
    while not ended:
        (action,) = policy(observation[None], info["action_mask"][None], rng)
        after, _, terminated, truncated, info = env.step(int(action))
        ended = terminated or truncated
        picks.append((observation, action, *(info[name] for name in _TOLD)))
        heaps.append(env.heap)
        outcomes.append(env.outcome)
        observation = after
    return Episode(*(np.array(column) for column in zip(*picks)), tuple(heaps), tuple(outcomes))
