"""The paper's outlook: other networks and rewards, and the agent that never fails.

    python -m studies variants

Two grids. The runs of the first differ from the paper's configuration in one thing, and in what
makes them affordable: fewer picks and a smaller batch. Networks without a fused update are small,
too, and so is the paper's beside them.
"""

from dataclasses import replace
from functools import partial

from studies.changes import height_reward
from studies.falls import measures
from studies.grid import Cell, Grid, train_grid
from studies.networks import NETWORKS as KINDS
from studies.results import COMMAND
from unload.agent.config import TrainConfig
from unload.agent.greedy import Greedy, load_policy, save_policy
from unload.support import files

CONFIG = TrainConfig(picks=1_000_000, batch_size=256, log_interval=500)
SEEDS = range(10)
SMALL = TrainConfig(picks=320_000, batch_size=64, n_features=32, log_interval=500)
LOADS = {"episodes": 200, "seed": 1000}  # fresh containers for each trained policy
SHARES = (0.25, 0.5, 0.9)  # of the height in the reward
RECOMMENDED = TrainConfig(picks=1_000_000, equalize=False, log_interval=500)


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
