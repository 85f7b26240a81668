"""The laboratory's answers: how long an order of equals lasts, and where a preference comes from.

    python -m studies ties_laboratory

``data/ties/PLAN.md`` says what was expected of its cells.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from studies.falls.cells import CONFIG
from studies.falls.laboratory import SLOPES, keep_cells, publish_cells
from studies.grid import Cell
from studies.seamless.jamming import weigh
from studies.ties.noise import drifting
from studies.ties.renewed import renewed
from unload import task
from unload.agent.training import Training
from unload.load.boxes import Load
from unload.load.substacks import stack_load

RHOS = (0.0, 0.8, 0.9, 0.965, 0.985, 0.997, 1.0)
# The plan's seeds, and those of its deviation 10.
SEEDS = (*range(4000, 4010), *range(5000, 5020))
SIGN_SEEDS = (*range(4100, 4120), *range(5100, 5120))
POSITIONS = replace(CONFIG, equalize=False)


def mirrored_load(rng: np.random.Generator) -> Load:
    """One of the paper's loads, its left and right exchanged."""
    load = stack_load(rng)
    positions = load.positions * [1, -1, 1] + [0, task.CONTAINER[1], 0]
    return Load(positions, load.sizes, load.packages, load.walls)


def mirror_loads(run: Training) -> None:
    """Fill the containers with loads whose left and right are exchanged."""
    run.rollout.envs.unwrapped.stack = mirrored_load
    run.rollout._observe(*run.rollout.envs.reset(seed=run.config.seeds()[0]))


def _ties(change: Callable[[Training], None], mask: bool) -> Cell:
    """A cell in which a change breaks the ties."""
    return Cell(replace(CONFIG, position_noise=0.0, mask=mask), SEEDS, change)


def _by_rho(rho: float, mask: bool) -> Cell:
    return _ties(partial(drifting, correlation=(rho, rho, rho)), mask)


CELLS = {
    **{f"rho_{rho}_no_mask": _by_rho(rho, False) for rho in RHOS},
    **{f"rho_{rho}": _by_rho(rho, True) for rho in RHOS},
    "renewed_no_mask": _ties(renewed, False),
    "renewed": _ties(renewed, True),
    "renewed_0.965_no_mask": _ties(partial(renewed, correlation=(0.965,) * 3), False),
    "renewed_0.965": _ties(partial(renewed, correlation=(0.965,) * 3), True),
    "positions": Cell(POSITIONS, SIGN_SEEDS),
    "positions_mirrored": Cell(POSITIONS, SIGN_SEEDS, mirror_loads),
    "positions_whole_walls": Cell(POSITIONS, SIGN_SEEDS, partial(weigh, z=0.0)),
    "ranks": Cell(CONFIG, SIGN_SEEDS),
    "ranks_mirrored": Cell(CONFIG, SIGN_SEEDS, mirror_loads),
    "ranks_whole_walls": Cell(CONFIG, SIGN_SEEDS, partial(weigh, z=0.0)),
}


def laboratory_data(n_jobs: int = -1) -> None:
    """Train all cells; write ``ties/laboratory.csv``, a row per run.

    It has ``cell`` and ``seed``, the MSR over the last tenth (``end``), and the slopes before the
    last pick.
    """
    results, columns = keep_cells("ties/laboratory", CELLS, n_jobs), ["cell", "seed", "end"]
    publish_cells("ties/laboratory", "ties_laboratory", [*columns, *SLOPES], results)
