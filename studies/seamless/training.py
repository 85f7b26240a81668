"""The paper's training where a share of the free boxes jams, for Figs. 11 and 12.

    python -m studies seamless

The plan, ``data/seamless/PLAN.md``, says why its grid has these cells and seeds.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from studies import changes, paths
from studies.grid import Cell, Grid, train_grid
from studies.results import COMMAND, JOBS
from studies.seamless.jamming import jam, weigh
from unload.agent.config import TrainConfig
from unload.agent.training import Training

SHARE = 0.4  # j; the paper's start of 15 % and end of 60 % need about so much
FIRST_SEED = 40
SEEDS, FEW_SEEDS = range(FIRST_SEED, FIRST_SEED + 5), range(FIRST_SEED, FIRST_SEED + 3)
CONFIG = TrainConfig(batch_size=256)
MASKS = {"mask": True, "no_mask": False}
# How equal coordinates are ranked: by the simulation's noise, by the items' order, or not at all.
TIES = {"noise": {}, "order": {"position_noise": 0.0}, "averaged": {"ties": "average"}}


def _cell(
    mask: str, ties: str, change: Callable[[Training], None], seeds: Sequence[int], **fields
) -> Cell:
    config = replace(CONFIG, mask=MASKS[mask], **TIES[ties], **fields)
    return Cell(config, seeds, change)


ANEW = partial(jam, share=SHARE)
CELLS: dict[str, Cell] = {
    **{
        f"{mask}_{ties}": _cell(mask, ties, ANEW, SEEDS)
        for ties in ("order", "noise", "averaged")
        for mask in MASKS
    },
    **{
        f"share_{share}_mask_order": _cell("mask", "order", partial(jam, share=share), FEW_SEEDS)
        for share in (0.2, 0.3)
    },
    **{
        f"until_success_{mask}_order": _cell(
            mask, "order", partial(jam, share=SHARE, lasts=1), FEW_SEEDS
        )
        for mask in MASKS
    },
    **{
        f"weight_1_{mask}_{ties}": _cell(mask, ties, partial(weigh, z=1.0), FEW_SEEDS)
        for mask, ties in (("mask", "noise"), ("no_mask", "noise"), ("mask", "order"))
    },
    "shuffled_mask_noise": _cell(
        "mask", "noise", partial(changes.several, makes=(ANEW, changes.shuffled)), FEW_SEEDS
    ),
    "positions_mask_noise": _cell("mask", "noise", ANEW, FEW_SEEDS, equalize=False),
    "b2048_mask_order": _cell("mask", "order", ANEW, SEEDS, batch_size=2048),
    "b2048_no_mask_order": _cell("no_mask", "order", ANEW, SEEDS, batch_size=2048),
}
SEAMLESS = Grid("seamless/runs", f"{COMMAND} seamless", CELLS)
OPTIONS = {
    "--cells": {"nargs": "+", "choices": CELLS},
    "--picks": {"type": int, "help": "of a run, if not the paper's; the data go to data/reduced"},
    **JOBS,
}


def seamless_data(
    cells: Sequence[str] | None = None,
    picks: int | None = None,
    folder: str | Path = paths.DATA,
    runs_dir: str | Path = paths.RUNS,
    n_jobs: int = -1,
) -> None:
    """Train the cells, see ``train_grid``."""
    train_grid(SEAMLESS, cells, picks, folder, runs_dir, n_jobs)
