"""The learning curve of a training run: means over every ``log_interval`` steps."""

import time
from collections.abc import Iterable

import numpy as np
import pandas as pd

CURVE_COLUMNS = (
    "picks", "mean_reward", "success_rate", "deadlocked", "loss", "epsilon", "wall_time"
)  # fmt: skip
SUMS = ("picks", "rewards", "deadlocked", "updates", "losses")


class Curve:
    """Points of a curve, and the sums since the last one.

    Attributes:
        points: one tuple of ``CURVE_COLUMNS`` each, see ``TrainResult``.
        sums: by the names in ``SUMS``.
    """

    def __init__(self) -> None:
        self.points: list[tuple[float, ...]] = []
        self._start_point()

    def _start_point(self) -> None:
        self.sums = dict.fromkeys(SUMS, 0.0)

    def add(self, rewards: np.ndarray, deadlocked: np.ndarray, losses: Iterable[float]) -> None:
        """Count one step.

        Args:
            rewards: (num_envs,) of its picks.
            deadlocked: (num_envs,) bool, picks of items that had failed since the last success.
            losses: of its updates.
        """
        sums = self.sums
        sums["picks"] += len(rewards)
        sums["rewards"] += rewards.sum()
        sums["deadlocked"] += deadlocked.sum()
        for loss in losses:
            sums["losses"] += loss
            sums["updates"] += 1

    def end_point(self, picks: int, epsilon: float) -> None:
        """Add the point of the steps since the last one, after ``picks`` picks in all."""
        sums = self.sums
        mean_reward = sums["rewards"] / sums["picks"]
        loss = sums["losses"] / sums["updates"] if sums["updates"] else float("nan")
        self.points.append((
            picks, mean_reward, (mean_reward + 1) / 2, sums["deadlocked"] / sums["picks"],
            loss, epsilon, time.time(),
        ))  # fmt: skip
        self._start_point()

    def table(self) -> pd.DataFrame:
        """Return one row per point, with the columns ``CURVE_COLUMNS``."""
        return pd.DataFrame(self.points, columns=CURVE_COLUMNS)

    def state(self) -> dict[str, np.ndarray]:
        """Return what ``load_state`` needs to go on from here."""
        points = np.array(self.points, dtype=np.float64).reshape(-1, len(CURVE_COLUMNS))
        return {"points": points, "sums": np.array([self.sums[name] for name in SUMS])}

    def load_state(self, arrays: dict[str, np.ndarray]) -> None:
        """Go on from what ``state`` returned."""
        self.points = [(int(picks), *means) for picks, *means in arrays["points"].tolist()]
        self.sums = dict(zip(SUMS, arrays["sums"].tolist(), strict=True))
