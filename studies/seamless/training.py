"""The paper's training where a share of the free boxes jams, for Figs. 11 and 12.

    python -m studies seamless

The plan, ``data/seamless/PLAN.md``, says why its grid has these cells and seeds.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd

from studies import changes
from studies.grid import Cell, Grid, read_grid, train_grid
from studies.results import COMMAND, write_table
from studies.seamless.jamming import jam, jam_by_place, weigh
from unload import task
from unload.agent.checkpoint import RunFolder, settings_of_run
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
# Share of the free boxes that jam along episodes by the friction of a contact, by whether a box
# stands in front, and by the number of those at the sides (``jam_tables.first_attempts``), when
# 17 of 20 episodes had been played.
BY_PLACE = {
    0.64: np.array(((0.0, 0.05, 0.15, 0.52), (0.0, 0.12, 0.5, 0.68))),
    1.0: np.array(((0.01, 0.13, 0.47, 0.78), (0.04, 0.38, 0.83, 0.98))),
}
LASTS = 20  # successes of others within which a jam is drawn again, see ``jam_tables.again``
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
    **{
        f"measured_{friction}_{mask}_order": _cell(
            mask, "order", partial(jam_by_place, shares=shares, lasts=LASTS), FEW_SEEDS
        )
        for friction, shares in BY_PLACE.items()
        for mask in MASKS
    },
    "b2048_mask_order": _cell("mask", "order", ANEW, SEEDS, batch_size=2048),
    "b2048_no_mask_order": _cell("no_mask", "order", ANEW, SEEDS, batch_size=2048),
}
EXPORTED = "b2048_no_mask_order", 41  # chosen afterwards among those like the paper's figures
SEAMLESS = Grid("seamless/runs", f"{COMMAND} seamless", CELLS)


def seamless_data(cells: Sequence[str] | None = None, n_jobs: int = -1) -> None:
    """Train the cells, see ``train_grid``; export the run ``EXPORTED``."""
    kept = train_grid(SEAMLESS, cells, n_jobs)
    cell, seed = EXPORTED
    if cells is None or cell in cells:
        config, change = replace(CELLS[cell].config, seed=seed), CELLS[cell].change
        settings = settings_of_run(config, change=change)
        run = RunFolder(kept / f"{cell}/seed_{seed}").result(config, settings)
        export(run.curve["wall_time"])


def export(wall_time: Sequence[float]) -> None:
    """Write a published run as TensorBoard exports it, which the paper's plots read.

    ``loss_function_agent.csv`` has the loss, ``total_rew_function_agent.csv`` the rewards summed
    over an episode of 500 picks, a mean over the environments; both have the columns ``Wall time``,
    ``Step`` and ``Value``.

    Args:
        wall_time: of each point of its curve, s since the epoch.
    """
    cell, seed = EXPORTED
    curves = read_grid(SEAMLESS, [cell])
    curve = curves[curves["seed"] == seed].reset_index(drop=True)
    for name, values in (
        ("loss_function_agent", curve["loss"]),
        ("total_rew_function_agent", (2 * curve["success_rate"] - 1) * task.MAX_PICKS),
    ):
        table = pd.DataFrame({"Wall time": wall_time, "Step": curve["picks"], "Value": values})
        write_table(name, table.dropna(), "%.12g")
