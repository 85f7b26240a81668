"""The third plan: when a preference becomes a mistake, on fresh seeds of the laboratory.

    python -m studies fresh

The third part of ``data/falls/PLAN.md`` says what each cell is for.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import pandas as pd
import torch

from studies import changes, paths
from studies.falls import measures
from studies.falls.laboratory import (
    AVERAGED,
    CONFIG,
    JUDGED,
    SEEN,
    SLOPES,
    TAKEN_BACK,
    keep_cells,
    point,
    train_in_laboratory,
)
from studies.fingerprint import training_fingerprint
from studies.grid import Cell
from studies.results import COMMAND, publish, read_table
from studies.statistics import end_msr
from unload.agent.config import TrainConfig
from unload.agent.identity import unchanged
from unload.agent.training import Training

FIRST_SEED, SEEDS, FEW_SEEDS = 3000, 20, 10
THRESHOLDS = 0.22, 0.42  # preferences along x and y above which a network errs
ERRS = 0.95  # MSR in fresh containers below which a network errs
HELD_FROM = 96_000  # picks, the middle of exploration
HELD_EVERY, MOST_HELD = 10, 1.05  # steps between two looks, and by how much one scales
EPSILONS = (0.05, 0.1, 0.2)
PREFERENCES = (0.2, 0.4, 0.8, 1.2)  # of teachers


def held(run: Training, start: int, axes: tuple[int, ...] = (2,)) -> None:
    """From some picks on, do not let the score's slope along z sink.

    Where it has sunk below what it was at ``start``, weights of the extractor are scaled up.

    Args:
        run: with the paper's network.
        start: picks.
        axes: whose weights are scaled: z alone, or all three, which leaves their ratios alone.
    """
    step, network, slopes = run.step, run.agent.network, []

    def step_held() -> None:
        step()
        if run.rollout.picks < start or run.rollout.steps % HELD_EVERY:
            return
        slopes.append(measures.slopes(network, run.rollout.observations)[2])
        if 0 < slopes[-1] < slopes[0]:
            with torch.no_grad():
                factor = min(MOST_HELD, slopes[0] / slopes[-1])
                network.extractor.weight[:, list(axes)] *= factor

    run.step = step_held


def _cell(change: Callable[[Training], None] = unchanged, seeds: int = SEEDS, **fields) -> Cell:
    return Cell(replace(CONFIG, **fields), range(FIRST_SEED, FIRST_SEED + seeds), change)


def _taught(preference: float, epsilon: float) -> Cell:
    """Only watch a policy that prefers a side and picks some boxes at random."""
    exploring = {"epsilon_init": epsilon, "epsilon_final": epsilon}
    change = partial(changes.taught, preference=preference)
    return _cell(change, FEW_SEEDS, picks=128_000, **exploring)


HELD = partial(held, start=HELD_FROM)
CELLS: dict[str, Cell] = {
    "ranks": _cell(),
    "ranks_features": _cell(**TAKEN_BACK["features"]),
    "averaged": _cell(**AVERAGED),
    "held": _cell(HELD),
    "held_no_mask": _cell(HELD, mask=False),
    "held_all": _cell(partial(held, start=HELD_FROM, axes=(0, 1, 2))),
    "shuffled_no_mask": _cell(changes.shuffled, mask=False),
    "shuffled_no_mask_learning_rate": _cell(
        changes.shuffled, mask=False, **TAKEN_BACK["learning_rate"]
    ),
    **{f"epsilon_{each}": _cell(epsilon_final=each) for each in EPSILONS},
    **{f"taught_{rho}_epsilon_0.5": _taught(rho, 0.5) for rho in PREFERENCES},
    "taught_0.4_epsilon_1.0": _taught(0.4, 1.0),
}
COLUMNS = ["cell", "seed", "end", *JUDGED, "judged_averaged_x", *SLOPES]


def run_cell(name: str, cell: Cell, seed: int) -> dict:
    """Train and measure a run: a row of ``COLUMNS``."""
    config, points = replace(cell.config, seed=seed), []
    run = train_in_laboratory(config, cell.change, lambda run: points.append(point(run)))
    network = run.agent.network
    row = {"cell": name, "seed": seed, "end": end_msr(run.curve.table())}
    row |= measures.judged_blanked(network, config)
    positions = replace(config, equalize=False)  # they are ranked after the environment
    row["judged_averaged_x"] = measures.judged(network, positions, seen=SEEN["averaged_x"])
    return row | {name: points[-1][name] for name in SLOPES}


def fresh_data(
    folder: str | Path = paths.DATA, runs_dir: str | Path = paths.RUNS, n_jobs: int = -1
) -> None:
    """Train the cells; write ``falls/fresh.csv``, a row per run.

    Its columns are those of ``falls/laboratory.csv``, and ``judged_averaged_x``: the MSR in fresh
    containers if equal x share one rank when the trained network chooses.
    """
    results = keep_cells(Path(runs_dir) / "fresh", CELLS, run_cell, n_jobs)
    table = pd.DataFrame([result.value for result in results])[COLUMNS]
    settings, fingerprint = {"config": CONFIG.plain(), "runs": len(table)}, training_fingerprint()
    place, command = Path(folder) / "falls", f"{COMMAND} fresh"
    publish(place, "fresh", {"fresh": table}, command, settings, results, fingerprint, "%.4g")


def read_fresh(folder: str | Path = paths.DATA) -> pd.DataFrame:
    """A row per run, see ``fresh_data``."""
    return read_table(Path(folder) / "falls/fresh.csv", f"{COMMAND} fresh", COLUMNS)


def predicted(table: pd.DataFrame, config: TrainConfig = CONFIG) -> pd.Series:
    """Whether each network errs, by its preferences alone.

    Where equal x share one rank, a preference along x cannot put a box before the one on it.

    Args:
        table: with ``SLOPES``.
        config: of the runs.
    """
    along = table[["slope_x", "slope_y"]].abs().div(table["slope_z"].abs(), axis=0)
    along_x, along_y = THRESHOLDS
    side = along["slope_y"] > along_y
    return side if config.ties == "average" else side | (along["slope_x"] > along_x)
