"""Orders of picks compared: which of them could be carried out from the entrance."""

import numpy as np
import pandas as pd

import unload

RULES = ("recommended", "highest", "nearest", "reachable")


def compare_orders(loads: int = 3, picks: int = 500, seed: int = 0) -> pd.DataFrame:
    """Let each rule unload the same loads of the paper.

    Args:
        loads: how many.
        picks: the first ones of each load count.
        seed: of the loads.

    Returns:
        A row for each rule: ``behind``, the share of picks of a box behind another one, see
        ``Load.behind``; ``travel``, the mean distance in m from one picked box to the next; and
        ``failed``, the number of failed picks.
    """
    rng = np.random.default_rng(seed)
    stacked = [unload.stack_load(rng) for _ in range(loads)]
    rows = {}
    for rule in RULES:
        orders = [unload.picking_order(load, rule).head(picks) for load in stacked]
        travel = [
            np.linalg.norm(np.diff(load.positions[order["item"]], axis=0), axis=1)
            for load, order in zip(stacked, orders)
        ]
        together = pd.concat(orders)
        failed = (~together["unloaded"]).sum()
        rows[rule] = (together["behind"].mean(), np.concatenate(travel).mean(), failed)
    return pd.DataFrame(rows, index=["behind", "travel", "failed"]).T.astype({"failed": int})
