"""The paper's two grids: its search in the tuning environment, and its training in the container.

The first plan, ``data/falls/FIRST_PLAN.md``, says why the training has these cells and seeds.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pandas as pd

from unload import task
from unload.agent.config import TrainConfig
from unload.reproduce.grid import Cell, Grid, read_grid
from unload.reproduce.results import COMMAND
from unload.support import checks, files

LEARNING_RATES = (1e-1, 1e-2, 1e-3)
BATCH_SIZES = (64, 256, 1024, 2048)
RUN_COUNT = 10  # of each configuration
STEPS = 3000  # K, one pick in each of 64 environments and one update per step


def tuning_config(
    batch_size: int, learning_rate: float, run: int = 0, equalize: bool = True, steps: int = STEPS,
    **changes,
) -> TrainConfig:  # fmt: skip
    """One run in the hyperparameter-tuning environment (Sec. IV-A).

    Args:
        batch_size: b.
        learning_rate: μ.
        run: number of the run, its seed.
        equalize: with the paper's feature engineering (FE) or without.
        steps: K.
        **changes: further fields of ``TrainConfig``.
    """
    checks.integer("steps", steps, 1)
    return TrainConfig(
        env="unload/HighestItem-v0",
        picks=steps * task.NUM_ENVS,
        batch_size=batch_size,
        learning_rate=learning_rate,
        seed=run,
        equalize=equalize,
        log_interval=1,
        **changes,
    )


def tuning_cell(batch_size: int, learning_rate: float, equalize: bool) -> str:
    """The name of a cell of the search, such as ``with_fe_b64/lr_0.1``."""
    return f"{'with' if equalize else 'without'}_fe_b{batch_size}/lr_{learning_rate:g}"


def tuning_grid(
    learning_rates: Sequence[float] = LEARNING_RATES,
    batch_sizes: Sequence[int] = BATCH_SIZES,
    runs: int = RUN_COUNT,
    equalize: Sequence[bool] = (True, False),
    steps: int = STEPS,
) -> Grid:
    """The paper's search, or a smaller one.

    The slow runs, of large batches, come first, so that no process is left with one of them at
    the end.
    """
    cells = {
        tuning_cell(batch_size, learning_rate, equalized): Cell(
            tuning_config(batch_size, learning_rate, equalize=equalized, steps=steps),
            range(checks.integer("runs", runs, 1)),
        )
        for batch_size in sorted(batch_sizes, reverse=True)
        for equalized in equalize
        for learning_rate in learning_rates
    }
    return Grid("tuning/tuning", f"{COMMAND} tuning", cells, policies=False)


TUNING = tuning_grid()

B2048 = TrainConfig()
CONFIG = replace(B2048, batch_size=256)


def _both(name: str, config: TrainConfig, seeds: int, masked_seeds: int) -> dict[str, Cell]:
    """A cell without the mask in training, and one with it."""
    return {
        f"{name}_no_mask": Cell(config, range(seeds)),
        f"{name}_mask": Cell(replace(config, mask=True), range(masked_seeds)),
    }


# The paper's configuration read in four ways, and two changes that hold its runs up.
PAPER_CELLS = {
    **_both("paper", CONFIG, 10, 10),
    **_both("paper_b2048", B2048, 8, 8),
}
PAPER = Grid(
    "falls/paper",
    f"{COMMAND} training",
    PAPER_CELLS
    | {
        **_both("averaged", replace(CONFIG, ties="average"), 5, 10),
        "averaged_b2048_mask": Cell(replace(B2048, mask=True, ties="average"), range(10)),
        **_both("positions", replace(CONFIG, equalize=False), 5, 5),
    },
)
DEFAULTS = "paper_b2048_no_mask"  # the cell of ``TrainConfig``'s defaults, of Figs. 11 and 12
DEFAULT_SEEDS = range(4)  # of its runs that the figures show; the first is the paper's line


def paper_runs(folder: str | Path = files.DATA) -> list[tuple[str, int, pd.DataFrame]]:
    """Cell, seed and curve of each published run of the paper's four cells."""
    curves = read_grid(PAPER, folder, PAPER_CELLS)
    groups = curves.groupby(["cell", "seed"], sort=False)
    return [(cell, seed, curve) for (cell, seed), curve in groups]
