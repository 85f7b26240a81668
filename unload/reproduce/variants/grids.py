"""Other networks, rewards and settings, and the recommended agent: a grid each.

    python -m unload.reproduce variants

The first three differ from the paper's configuration in one thing, and in what makes them
affordable: fewer picks and a smaller batch. Networks without a fused update are small, too, and
so is the paper's beside them.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from unload.agent.config import TrainConfig
from unload.agent.evaluation import evaluate
from unload.agent.greedy import Greedy, load_policy, save_policy
from unload.reproduce.changes import height_reward
from unload.reproduce.grid import Cell, Grid, train_grid
from unload.reproduce.results import COMMAND, JOBS
from unload.support import checks, files

CONFIG = TrainConfig(picks=1_000_000, batch_size=256)
SEEDS = range(3)
SMALL = TrainConfig(picks=320_000, batch_size=64, n_features=32)
LOADS = {"episodes": 200, "seed": 1000}  # fresh containers for each trained policy
SHARES = (0.25, 0.5, 0.9)  # of the height in the reward
RECOMMENDED = TrainConfig(picks=1_000_000, equalize=False)


def judged(policy: Greedy, config: TrainConfig) -> dict[str, float]:
    """MSR of a trained policy in fresh containers: ``msr_mask`` and ``msr_no_mask``."""
    ready = Greedy(policy.network, equalize=False)  # the environment equalizes, which is faster
    seen = {"equalize": config.equalize, "ties": config.ties}
    return {
        f"msr_{name}": evaluate(ready, mask=mask, **LOADS, **seen)["success_rate"].mean()
        for name, mask in (("mask", True), ("no_mask", False))
    }


def _setting(field: str, value: float) -> dict[str, Cell]:
    """The cell in which one setting is changed; its name says which."""
    return {f"{field}_{value}": Cell(replace(CONFIG, **{field: value}), SEEDS)}


_grid = partial(Grid, command=f"{COMMAND} variants", measure=judged)
GRIDS = {
    # Attention has fewer seeds, because to train and to judge it takes five times as long.
    "networks": _grid(
        "variants/networks",
        cells={
            name: Cell(replace(SMALL, network=name), range(2) if name == "attention" else SEEDS)
            for name in ("peq", "two_layer", "stack", "attention")
        },
    ),
    # The paper's outlook: failing at a higher item is less bad. What stays as it is, its control,
    # is a cell of the settings.
    "rewards": _grid(
        "variants/rewards",
        cells={f"height_{share}": Cell(CONFIG, SEEDS, height_reward(share)) for share in SHARES},
    ),
    "settings": _grid(
        "variants/settings",
        cells={"unchanged": Cell(CONFIG, SEEDS)}
        | _setting("n_features", 16)
        | _setting("n_features", 256)
        | _setting("learning_rate", 1e-4)
        | _setting("learning_rate", 1e-2)
        | _setting("batch_size", 64)
        | _setting("batch_size", 2048)
        | _setting("gradient_steps", 4),
    ),
    # The paper's configuration but for one thing, and shorter: positions, not ranks.
    "recommended": _grid("variants/recommended", cells={"positions": Cell(RECOMMENDED, range(5))}),
}
OPTIONS = {"--grids": {"nargs": "+", "choices": GRIDS, "default": tuple(GRIDS)}, **JOBS}


def variants_data(
    grids: Sequence[str] = tuple(GRIDS),
    picks: int | None = None,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = -1,
    progress: bool = True,
    shipped: str | Path = files.SHIPPED,
) -> None:
    """Train some grids, see ``train_grid``.

    The recommended agent's first run also leaves ``policies/recommended.safetensors``.

    Args:
        grids: names in ``GRIDS``.
        picks: of each run, those of the plan if None.
        folder: of the data.
        runs_dir: where the runs are kept.
        n_jobs: processes, see ``run_sweep``.
        progress: show a progress bar.
        shipped: folder of the policy.

    Raises:
        ValueError: an unknown grid.
        RuntimeError: runs failed; the message says which and why.
    """
    for name in grids:
        checks.one_of("grids", name, GRIDS)
    for name in grids:
        kept = train_grid(GRIDS[name], None, picks, folder, runs_dir, n_jobs, progress)
        if name == "recommended" and picks is None:
            best = load_policy(kept / "positions/seed_0/policy.safetensors")
            save_policy(best, Path(shipped) / "policies/recommended.safetensors")
