"""Picks that stay in the replay memory for good, as demonstrations do in DQfD (Hester et al. 2018).

Once nearly every pick succeeds, an ordinary memory soon holds hardly any failure to learn from.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np

from unload.agent.config import TrainConfig
from unload.agent.policies import any_allowed
from unload.agent.replay import ReplayBuffer
from unload.agent.rollout import Rollout
from unload.support import checks

OTHER_LOADS = 1_000_000  # is added to the seed where random picks are made
MOST_PICKS = 100  # random picks per wanted one


class KeptPicks(ReplayBuffer):
    """A replay memory, a part of which holds given picks for good.

    The other picks overwrite each other only, and batches are drawn from both parts alike.

    Args:
        size, items, next_state, equalized: of the whole memory, see ``ReplayBuffer``.
        count: picks that are kept, fewer than ``size``.
        kept: batches of them, as ``ReplayBuffer.add`` takes them.

    Attributes:
        size: room for the other picks.

    Raises:
        ValueError: ``kept`` does not hold ``count`` picks, or as ``ReplayBuffer`` does.
    """

    def __init__(
        self,
        size: int,
        items: int,
        count: int,
        kept: Iterable[dict[str, np.ndarray]],
        next_state: bool = False,
        equalized: bool = False,
    ) -> None:
        size = checks.integer("size", size, 1)
        count = checks.integer("count", count, 0, size - 1)
        super().__init__(size, items, next_state, equalized)
        self.size = filled = size - count
        for batch in kept:
            more = len(batch["rewards"])
            self.overwrite(np.arange(filled, filled + more), **batch)
            filled += more
        if filled != size:
            raise ValueError(f"kept holds {filled - self.size} picks; expected count={count}")

    def __len__(self) -> int:
        return super().__len__() + len(self.arrays["rewards"]) - self.size

    def filled(self) -> np.ndarray:
        return self._passing_over(super().filled())

    def sample_rows(self, batch_size: int, rng: np.random.Generator) -> np.ndarray:
        return self._passing_over(super().sample_rows(batch_size, rng))

    def _passing_over(self, rows: np.ndarray) -> np.ndarray:
        """Slots by their place among those that hold a pick."""
        others = min(self.total, self.size)
        return np.where(rows < others, rows, rows + self.size - others)


def random_picks(
    config: TrainConfig,
    count: int,
    rng: np.random.Generator,
    succeeded: bool | None = False,
    stack: Callable | None = None,
) -> Iterator[dict[str, np.ndarray]]:
    """Picks of a random policy in containers of their own, by default those that failed.

    Args:
        config: of the containers; the loads are drawn with another seed.
        count: how many.
        rng: draws the picks.
        succeeded: whether they are the picks that succeeded or those that failed; all if None.
        stack: makes the loads, see ``unload.train``.

    Yields:
        Batches as ``ReplayBuffer.add`` takes them.

    Raises:
        ValueError: such picks are so rare that ``MOST_PICKS`` picks for each are not enough.
    """
    most = config.num_envs * (MOST_PICKS * count // config.num_envs + 1)
    config = replace(config, seed=config.seed + OTHER_LOADS, picks=most, failures_kept=0.0)
    rollout = Rollout(config, 1, stack)
    try:
        while count:
            if rollout.finished:
                raise ValueError(
                    f"of {most} random picks too few {'succeed' if succeeded else 'fail'}; "
                    f"{count} are missing"
                )
            rewards, transitions = rollout.pick(any_allowed(rollout.allowed, rng))
            chosen = (
                np.ones(len(rewards), bool) if succeeded is None else (rewards > 0) == succeeded
            )
            wanted = np.flatnonzero(chosen)[:count]
            count -= len(wanted)
            yield {name: values[wanted] for name, values in transitions.items()}
    finally:
        rollout.close()
