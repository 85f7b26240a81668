"""The paper's outlook: other networks and rewards, and the agent that never fails.

    python -m studies variants

Two grids. The runs of the first differ from the paper's configuration in one thing, and in what
makes them affordable: fewer picks and a smaller batch. Networks without a fused update are small,
too, and so is the paper's beside them.
"""

from dataclasses import replace
from functools import partial
from itertools import product

import pandas as pd
from scipy import stats

from studies.changes import height_reward
from studies.falls import measures
from studies.grid import Cell, Grid, train_grid
from studies.networks import NETWORKS as KINDS
from studies.results import COMMAND, read_table
from unload.agent.config import TrainConfig
from unload.agent.greedy import Greedy, load_policy, save_policy
from unload.support import files

CONFIG = TrainConfig(picks=1_000_000, batch_size=256, log_interval=500)
SEEDS = range(10)
SMALL = TrainConfig(picks=320_000, batch_size=64, n_features=32, log_interval=500)
LOADS = {"episodes": 200, "seed": 1000}  # fresh containers for each trained policy
SHARES = (0.25, 0.5, 0.9)  # of the height in the reward
RECOMMENDED = TrainConfig(picks=1_000_000, equalize=False, log_interval=500)
APPLIED = {"msr_mask": "with the mask", "msr_no_mask": "without the mask"}


def judged(policy: Greedy, config: TrainConfig) -> dict[str, float]:
    """MSR of a trained policy in fresh containers: ``msr_mask`` and ``msr_no_mask``."""
    return {
        f"msr_{name}": measures.judged(policy.network, replace(config, mask=mask), loads=LOADS)
        for name, mask in (("mask", True), ("no_mask", False))
    }


NETWORKS = {
    name: Cell(replace(SMALL, network=kind), SEEDS)
    for name, kind in {"peq": "peq", **KINDS}.items()
}
# The paper's outlook: failing at a higher item is less bad.
REWARDS = {"unchanged": Cell(CONFIG, SEEDS)} | {
    f"height_{share}": Cell(CONFIG, SEEDS, partial(height_reward, share=share)) for share in SHARES
}
_grid = partial(Grid, command=f"{COMMAND} variants", measure=judged)
GRIDS = {
    "variants": _grid("variants", cells=NETWORKS | REWARDS),
    # The paper's configuration but for one thing, and shorter: positions, not ranks.
    "recommended": _grid("recommended", cells={"positions": Cell(RECOMMENDED, range(5))}),
}


def variants_data(n_jobs: int = -1) -> None:
    """Train both grids, see ``train_grid``.

    The recommended agent's first run is also the policy that comes with the package.
    """
    train_grid(GRIDS["variants"], n_jobs=n_jobs)
    kept = train_grid(GRIDS["recommended"], n_jobs=n_jobs)
    best = load_policy(kept / "positions/seed_0/policy.safetensors")
    save_policy(best, files.SHIPPED / "policies/recommended.safetensors")


def differences(cells: dict[str, Cell]) -> pd.DataFrame:
    """Differences of the cells' mean MSR from that of the first one, with their 95 % intervals.

    Args:
        cells: ``NETWORKS`` or ``REWARDS``.

    Returns:
        A row per cell and entry of ``APPLIED``: ``difference``, ``low`` and ``high`` by Welch's t,
        in points.
    """
    published = dict(list(read_table(GRIDS["variants"].name).groupby("cell")))
    (reference, *others), rows = cells, {}
    for name, column in product(others, APPLIED):
        one, other = (published[each][column] for each in (name, reference))
        interval = stats.ttest_ind(one, other, equal_var=False).confidence_interval()
        rows[name, APPLIED[column]] = (one.mean() - other.mean(), *interval)
    return 100 * pd.DataFrame(rows, index=["difference", "low", "high"]).T
