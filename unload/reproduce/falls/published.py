"""The published policies with a part of what they see blanked, and networks without training.

python -m unload.reproduce falls
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import torch

from unload import task
from unload.env.vector import ContainerVectorEnv
from unload.network.peq import PEQNetwork
from unload.reproduce.falls import measures
from unload.reproduce.falls.laboratory import JUDGED, SLOPES
from unload.reproduce.falls.long import CONFIG, LONG, trace_data
from unload.reproduce.fingerprint import training_fingerprint
from unload.reproduce.grid import Grid, read_policies, train_grid
from unload.reproduce.paper.grids import PAPER
from unload.reproduce.results import COMMAND, JOBS, keep_all, publish, read_table
from unload.support import files

LOADS = {"episodes": 100, "seed": 1000}
UNTRAINED = 36  # networks, as many as there are runs in the paper's four cells
COLUMNS = ["cell", "seed", *JUDGED, *SLOPES]
OPTIONS = {"--cells": {"nargs": "+", "choices": LONG.cells}, **JOBS}


def falls_data(
    cells: Sequence[str] | None = None,
    picks: int | None = None,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = -1,
    progress: bool = True,
) -> None:
    """Train the long runs, see ``train_grid``; then trace two, and judge all published policies.

    Of some cells, or of shorter runs, nothing is judged.
    """
    train_grid(LONG, cells, picks, folder, runs_dir, n_jobs, progress)
    if cells is None:
        trace_data(CONFIG.picks if picks is None else picks, folder, runs_dir, n_jobs, progress)
    if cells is None and picks is None:
        published_data(folder=folder, runs_dir=runs_dir, n_jobs=n_jobs, progress=progress)


def published_data(
    loads: dict = LOADS,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = -1,
    progress: bool = True,
) -> None:
    """Judge each published policy in fresh containers: ``falls/published.csv``.

    A row per policy: its cell and seed; its MSR as it is and with x, y or both set to 0, with the
    mask on; its slopes in full containers. The cell ``untrained`` holds networks as they are drawn.

    Args:
        loads: ``episodes`` and ``seed`` of the fresh containers, 500 picks each.
        folder: of the data.
        runs_dir: where what has been measured is kept.
        n_jobs: processes, as in joblib.
        progress: show a progress bar.
    """
    fingerprint = training_fingerprint()
    names = [(grid, name) for grid in (PAPER, LONG) for name in _names(grid, folder)]
    names += [(None, f"untrained/seed_{seed}") for seed in range(UNTRAINED)]
    jobs = [
        (
            {"name": name, "fingerprint": fingerprint, **loads},
            partial(_judge, grid, name, loads, Path(folder)),
        )
        for grid, name in names
    ]
    results = keep_all(Path(runs_dir) / "published", jobs, n_jobs, progress)
    publish(
        Path(folder) / "falls",
        "published",
        {"published": pd.DataFrame([result.value for result in results])[COLUMNS]},
        f"{COMMAND} falls",
        loads,
        loads != LOADS,
        [result.record for result in results],
        fingerprint,
    )


def _names(grid: Grid, folder: str | Path) -> list[str]:
    return list(read_policies(Path(folder) / f"{grid.name}.safetensors"))


def _judge(grid: Grid | None, name: str, loads: dict, folder: Path) -> dict:
    cell, _, seed = name.partition("/seed_")
    if grid is None:
        generator = torch.Generator().manual_seed(int(seed))
        config, network = PAPER.cells["paper_mask"].config, PEQNetwork(generator=generator)
    else:
        policy = read_policies(folder / f"{grid.name}.safetensors")[name]
        config, network = replace(grid.cells[cell].config, mask=True), policy.network
    row: dict[str, object] = {"cell": cell, "seed": int(seed)}
    for column, blank in zip(JUDGED, measures.BLANKED.values()):
        row[column] = measures.judged(network, config, blank, loads=loads)
    envs = ContainerVectorEnv(task.NUM_ENVS, equalize=config.equalize, ties=config.ties)
    observations, _ = envs.reset(seed=loads["seed"])
    envs.close()
    return row | dict(zip(SLOPES, map(float, measures.slopes(network, np.array(observations)))))


def read_published(folder: str | Path = files.DATA) -> pd.DataFrame:
    """The table of ``published_data``."""
    return read_table(Path(folder) / "falls/published.csv", f"{COMMAND} falls", COLUMNS)
