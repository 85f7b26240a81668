"""The table of the plan's cells as a reader sees it."""

from collections.abc import Iterable

import numpy as np
import pandas as pd

from unload.reproduce.answer import PAPER_CELLS, seeds_of
from unload.reproduce.verdict import cell_table
from unload.support import checks


def cell_texts(runs: Iterable[tuple[str, int, pd.DataFrame]], digits: int = 0) -> pd.DataFrame:
    """Return ``verdict.cell_table`` in percentages, with each interval beside its mean.

    Args:
        runs: cell, seed and curve of each, see ``unload.reproduce.answer.read_answer``.
        digits: after the point.

    Raises:
        TypeError, ValueError: ``digits`` is no integer ≥ 0.
    """
    digits = checks.integer("digits", digits, 0)

    def percent(value: float) -> str:
        return f"{value:.{digits}%}"

    def interval(row: pd.Series, name: str, low: str, high: str) -> str:
        if np.isnan(row[low]):
            return f"{percent(row[name])} ({'all alike' if row['runs'] > 4 else 'too few runs'})"
        return f"{percent(row[name])} ({percent(row[low])} to {percent(row[high])})"

    return pd.DataFrame(
        {
            PAPER_CELLS.get(row["cell"], row["cell"]): {
                "runs": f"{row['runs']} of {len(seeds_of(row['cell']))}",
                "mean (t interval)": interval(row, "mean", "low", "high"),
                "IQM (BCa interval)": interval(row, "iqm", "iqm_low", "iqm_high"),
                "lowest, highest": f"{percent(row['lowest'])}, {percent(row['highest'])}",
                "fell": row["fell"],
                "like Fig. 11": row["fig11"],
                "like Fig. 12": row["fig12"],
                "like both": row["both"],
            }
            for _, row in cell_table(runs).iterrows()
        }
    ).T
