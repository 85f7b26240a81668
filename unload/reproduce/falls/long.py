"""Runs of the paper's length with what the laboratory says changed; two of them traced.

python -m unload.reproduce falls
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import pandas as pd

from unload.agent.config import TrainConfig
from unload.reproduce.falls import changes
from unload.reproduce.falls.laboratory import POINT, point, train_in_laboratory
from unload.reproduce.fingerprint import training_fingerprint
from unload.reproduce.grid import Cell, Grid, train_grid
from unload.reproduce.results import COMMAND, JOBS, keep_all, publish, read_table
from unload.support import files

CONFIG = TrainConfig(batch_size=256, mask=True)
NO_MASK, B2048 = replace(CONFIG, mask=False), TrainConfig(mask=True)
SEEDS, FEW_SEEDS = range(20, 25), range(20, 23)
EXPLORED = 10_000_000  # picks after which the agent no longer explores
TRACED_SEEDS = (20, 21)
TRACE_EVERY = 32_000  # picks: an episode of all containers
LONG = Grid(
    "falls/long",
    f"{COMMAND} falls",
    {
        "shuffled": Cell(CONFIG, SEEDS, changes.shuffled),
        "ranks": Cell(CONFIG, SEEDS),
        "shuffled_no_mask": Cell(NO_MASK, SEEDS, changes.shuffled),
        "successes": Cell(CONFIG, SEEDS, partial(changes.successes_only, start=EXPLORED)),
        "ranks_no_mask": Cell(NO_MASK, SEEDS),
        "episodes_25": Cell(replace(CONFIG, max_picks=25), FEW_SEEDS),
        "mirrored": Cell(CONFIG, SEEDS, changes.mirrored),
        "shuffled_b2048": Cell(B2048, FEW_SEEDS, changes.shuffled),
        "shuffled_b2048_no_mask": Cell(replace(B2048, mask=False), FEW_SEEDS, changes.shuffled),
    },
    points=250,
)
OPTIONS = {"--cells": {"nargs": "+", "choices": LONG.cells}, **JOBS}


def falls_data(
    cells: Sequence[str] | None = None,
    picks: int | None = None,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = -1,
    progress: bool = True,
) -> None:
    """Train the long runs, see ``train_grid``; then trace two of the cell ``ranks``."""
    train_grid(LONG, cells, picks, folder, runs_dir, n_jobs, progress)
    if cells is None:
        trace_data(CONFIG.picks if picks is None else picks, folder, runs_dir, n_jobs, progress)


def trace_data(
    picks: int, folder: str | Path, runs_dir: str | Path, n_jobs: int, progress: bool
) -> None:
    """Trace runs with the mask, every 32,000 picks: ``falls/long_trace.csv``."""
    fingerprint = training_fingerprint()
    jobs = [
        (
            {"seed": seed, "picks": picks, "every": TRACE_EVERY, "fingerprint": fingerprint},
            partial(trace, replace(CONFIG, seed=seed, picks=picks)),
        )
        for seed in TRACED_SEEDS
    ]
    results = keep_all(Path(runs_dir) / "falls/trace", jobs, n_jobs, progress)
    tables = [
        pd.DataFrame(result.value).assign(seed=seed) for seed, result in zip(TRACED_SEEDS, results)
    ]
    reduced = picks < CONFIG.picks
    publish(
        Path(folder) / ("reduced/falls" if reduced else "falls"),
        "long_trace",
        {"long_trace": pd.concat(tables)[["seed", *POINT]].astype({"picks": int})},
        f"{COMMAND} falls",
        {"seeds": list(TRACED_SEEDS), "picks": picks},
        reduced,
        [result.record for result in results],
        fingerprint,
        "%.4g",
    )


def trace(config: TrainConfig) -> list[dict[str, float]]:
    """The points of a run's trace, see ``laboratory.point``."""
    points: list[dict[str, float]] = []
    train_in_laboratory(config, watch=lambda run: points.append(point(run)), every=TRACE_EVERY)
    return points


def read_long_trace(folder: str | Path = files.DATA) -> pd.DataFrame:
    """The points of the traced long runs."""
    path = Path(folder) / "falls/long_trace.csv"
    return read_table(path, f"{COMMAND} falls", ["seed", *POINT])
