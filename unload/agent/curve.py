"""The learning curve of a training run."""

import time
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

SUMS = ("picks", "rewards", "successes", "deadlocked", "updates", "losses")


class Point(NamedTuple):
    """A point of the learning curve: means over the steps since the one before.

    Attributes:
        picks: so far in all.
        mean_reward: of the environment.
        success_rate: MSR of the exploring agent, the share of picks with a positive reward.
        deadlocked: share of picks whose item had already failed since the last success.
        loss: NaN before the first update.
        epsilon: exploration rate at the last of them.
        wall_time: then, in s since the epoch.
    """

    picks: int
    mean_reward: float
    success_rate: float
    deadlocked: float
    loss: float
    epsilon: float
    wall_time: float


class Curve:
    """The learning curve: points over every ``log_interval`` steps, and the sums since the last.

    Attributes:
        points: so far.
        sums: since the last point, by the names in ``SUMS``.
    """

    def __init__(self) -> None:
        self.points: list[Point] = []
        self.sums = dict.fromkeys(SUMS, 0.0)

    def add(self, rewards: np.ndarray, deadlocked: np.ndarray, losses: Iterable[float]) -> None:
        """Count the picks of one step, (num_envs,) arrays, and the losses of its updates."""
        sums = self.sums
        sums["picks"] += len(rewards)
        sums["rewards"] += rewards.sum()
        sums["successes"] += (rewards > 0).sum()
        sums["deadlocked"] += deadlocked.sum()
        for loss in losses:
            sums["losses"] += loss
            sums["updates"] += 1

    def end_point(self, picks: int, epsilon: float) -> None:
        """Add the point of the steps since the last one, after ``picks`` picks in all."""
        sums = self.sums
        reward, deadlocked = sums["rewards"] / sums["picks"], sums["deadlocked"] / sums["picks"]
        # Computed so that for rewards of ±1 all bits are those of ``unload.success_rate``; other
        # tasks may pay other rewards.
        balance = (2 * sums["successes"] - sums["picks"]) / sums["picks"]
        loss = sums["losses"] / sums["updates"] if sums["updates"] else float("nan")
        self.points.append(
            Point(picks, reward, (balance + 1) / 2, deadlocked, loss, epsilon, time.time())
        )
        self.sums = dict.fromkeys(SUMS, 0.0)

    def table(self) -> pd.DataFrame:
        """Return one row per point."""
        return pd.DataFrame(self.points, columns=Point._fields)

    def csv(self) -> str:
        """Return the table as CSV."""
        return self.table().to_csv(index=False, lineterminator="\n")

    def state_dict(self) -> dict[str, Any]:
        """Return points and sums, for a checkpoint."""
        return {"points": [tuple(point) for point in self.points], "sums": self.sums}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Take back what ``state_dict`` returned."""
        self.points = [Point(*point) for point in state["points"]]
        self.sums = state["sums"]
