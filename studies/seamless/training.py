"""The paper's training where a share of the free boxes jams, for Figs. 11 and 12.

    python -m studies seamless

The plan, ``data/seamless/PLAN.md``, says why its grid has these cells and seeds; those of its cells
that are no longer here stand at revision ba9d78d1.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd

from studies import changes
from studies.grid import Cell, Grid, cell, train_grid
from studies.results import COMMAND, read_table, write_table
from studies.seamless.jamming import jam, jam_by_place, weigh
from unload import task
from unload.agent.config import TrainConfig
from unload.agent.training import finished_run

SHARE = 0.4  # j; the paper's start of 15 % and end of 60 % need about so much
FIRST_SEED = 40
SEEDS, FEW_SEEDS = range(FIRST_SEED, FIRST_SEED + 5), range(FIRST_SEED, FIRST_SEED + 3)
MASKS = {"mask": True, "no_mask": False}
# How equal coordinates are ranked: by the simulation's noise, by the items' order, or not at all.
NOISE = TrainConfig(batch_size=256)
ORDER, AVERAGED = replace(NOISE, position_noise=0.0), replace(NOISE, ties="average")
TIES = {"order": ORDER, "noise": NOISE, "averaged": AVERAGED}
ANEW = partial(jam, share=SHARE)
# Share of the free boxes that jam along episodes by the friction of a contact, by whether a box
# stands in front, and by the number of those at the sides (``seamless/jam_first``), when 17 of 20
# episodes had been played.
BY_PLACE = {
    0.64: np.array(((0.0, 0.05, 0.15, 0.52), (0.0, 0.12, 0.5, 0.68))),
    1.0: np.array(((0.01, 0.13, 0.47, 0.78), (0.04, 0.38, 0.83, 0.98))),
}
LASTS = 20  # successes of others within which a jam is drawn again, see ``seamless/jam_again``
UNTIL_SUCCESS, WEIGHT_1 = partial(jam, share=SHARE, lasts=1), partial(weigh, z=1.0)
CELLS: dict[str, Cell] = {
    **{
        f"{name}_{ties}": cell(config, SEEDS, ANEW, mask=mask)
        for ties, config in TIES.items()
        for name, mask in MASKS.items()
    },
    **{
        f"until_success_{name}_order": cell(ORDER, FEW_SEEDS, UNTIL_SUCCESS, mask=mask)
        for name, mask in MASKS.items()
    },
    "weight_1_mask_noise": cell(NOISE, FEW_SEEDS, WEIGHT_1, mask=True),
    "weight_1_no_mask_noise": cell(NOISE, FEW_SEEDS, WEIGHT_1),
    "weight_1_mask_order": cell(ORDER, FEW_SEEDS, WEIGHT_1, mask=True),
    "shuffled_mask_noise": cell(
        NOISE, FEW_SEEDS, partial(changes.several, makes=(ANEW, changes.shuffled)), mask=True
    ),
    "positions_mask_noise": cell(NOISE, FEW_SEEDS, ANEW, mask=True, equalize=False),
    **{
        f"measured_{friction}_{name}_order": cell(
            ORDER, FEW_SEEDS, partial(jam_by_place, shares=shares, lasts=LASTS), mask=mask
        )
        for friction, shares in BY_PLACE.items()
        for name, mask in MASKS.items()
    },
    **{
        f"b2048_{name}_order": cell(ORDER, SEEDS, ANEW, mask=mask, batch_size=2048)
        for name, mask in MASKS.items()
    },
}
EXPORTED = "b2048_no_mask_order", 41  # chosen afterwards among those like the paper's figures
SEAMLESS = Grid("seamless/runs", f"{COMMAND} seamless", CELLS)


def seamless_data(cells: Sequence[str] | None = None, n_jobs: int = -1) -> None:
    """Train the cells, see ``train_grid``; export the run ``EXPORTED``."""
    kept = train_grid(SEAMLESS, cells, n_jobs)
    name, seed = EXPORTED
    if cells is None or name in cells:
        config, change = replace(CELLS[name].config, seed=seed), CELLS[name].change
        run = finished_run(kept / f"{name}/seed_{seed}", config, change)
        export(run.curve["wall_time"])


def export(wall_time: Sequence[float]) -> None:
    """Write a published run as TensorBoard exports it, which the paper's plots read.

    ``loss_function_agent.csv`` has the loss, ``total_rew_function_agent.csv`` the rewards summed
    over an episode of 500 picks, a mean over the environments; both have the columns ``Wall time``,
    ``Step`` and ``Value``.

    Args:
        wall_time: of each point of its curve, s since the epoch.
    """
    name, seed = EXPORTED
    table = read_table(SEAMLESS.name)
    loss, msr = (table[f"{column} {name}/seed_{seed}"] for column in ("loss", "success_rate"))
    for exported, values in (
        ("loss_function_agent", loss),
        ("total_rew_function_agent", (2 * msr - 1) * task.MAX_PICKS),
    ):
        columns = {"Wall time": wall_time, "Step": table["picks"], "Value": values}
        write_table(exported, pd.DataFrame(columns).dropna(), "%.12g")
