"""The first mistake of a policy without the mask: it repeats it until the episode ends."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from scipy.stats import fisher_exact

from unload import task
from unload.agent.evaluation import Policy, evaluate
from unload.support import checks

EARLY = 100  # picks


def before_first_mistake(policy: Policy, episodes: int, seed: int) -> np.ndarray:
    """Return how many picks succeed before the first mistake, without the mask.

    Args:
        policy: one that does not change and has no memory.
        episodes: fresh containers.
        seed: of their loads.

    Returns:
        (episodes,) int, 500 where there is none.

    Raises:
        ValueError: an episode goes on after a mistake, so that the policy has a memory.
    """
    table = evaluate(policy, episodes, seed, mask=False)
    repeated = (task.MAX_PICKS * table["deadlocked"]).round().astype(int)
    mistakes = task.MAX_PICKS - table["unloaded"] - repeated
    if not mistakes.isin([0, 1]).all():
        raise ValueError(
            "policy makes several mistakes in an episode; expected one that repeats it"
        )
    return table["unloaded"].to_numpy()


def surviving(before: Sequence[int]) -> np.ndarray:
    """Return the share of episodes without a mistake in the first 0, 1, …, 500 picks."""
    before = np.asarray(before)
    return (before >= np.arange(task.MAX_PICKS + 1)[:, None]).mean(axis=1)


def constant_chance(before: Sequence[int]) -> float:
    """Return the chance of failure per pick, were it constant (maximum likelihood)."""
    failed, picks = _failures(before, 0, task.MAX_PICKS)
    return failed / picks


def early_and_late(before: Sequence[int], early: int = EARLY) -> pd.Series:
    """Compare the chance of failure in the first picks of an episode with that in the others.

    Args:
        before: (episodes,) successes before the first mistake.
        early: number of first picks, below 500.

    Returns:
        ``early`` and ``late``, the shares of picks that fail, NaN where there were none; ``p``
        of Fisher's two-sided test that they are equal.
    """
    checks.integer("early", early, 1, task.MAX_PICKS - 1)
    counts = [_failures(before, 0, early), _failures(before, early, task.MAX_PICKS)]
    shares = [failed / picks if picks else np.nan for failed, picks in counts]
    p = fisher_exact([[failed, picks - failed] for failed, picks in counts]).pvalue
    return pd.Series({"early": shares[0], "late": shares[1], "p": p})


def _failures(before: Sequence[int], first: int, last: int) -> tuple[int, int]:
    """First mistakes, and picks up to them, among the picks numbered ``first`` … ``last`` − 1."""
    before = np.asarray(before)
    failed = int(((before >= first) & (before < last)).sum())
    return failed, int(np.clip(before - first, 0, last - first).sum()) + failed
