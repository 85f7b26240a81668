"""The laboratory: the fall of the paper's configuration in two seconds a run.

    python -m studies laboratory

First its cells, as ``data/falls/PLAN.md`` names them; then how a run is trained and measured.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from studies import changes, paths
from studies.falls import measures
from studies.fingerprint import training_fingerprint
from studies.grid import Cell
from studies.results import COMMAND, JOBS, Result, keep_all, publish, read_table
from studies.statistics import end_msr
from studies.sweep import one_thread
from unload.agent.config import TrainConfig
from unload.agent.identity import identity, unchanged
from unload.agent.training import Training

# The mask is on by default.
CONFIG = TrainConfig(
    picks=384_000, batch_size=64, n_features=16, learning_rate=3e-3, replay_size=2**15,
    mask=True, log_interval=50,
)  # fmt: skip
FIRST_SEED = 2000
SEEDS, REMEDY_SEEDS, FEW_SEEDS = 20, 50, 10
AVERAGED = {"ties": "average"}
# What the laboratory changes of the paper's configuration, one at a time taken back.
TAKEN_BACK = {
    "learning_rate": {"learning_rate": 1e-3},
    "batch": {"batch_size": 256},
    "features": {"n_features": 64},
    "replay": {"replay_size": 2**19},  # forgets nothing
}
# What a network sees where the environments do not offer it, in choosing and in learning.
SEEN: dict[str, Callable] = {
    "height_alone": changes.without,
    "height_alone_no_mask": changes.without,
    "averaged_x": partial(changes.ranked, averaged=(0,)),
    "averaged_y": partial(changes.ranked, averaged=(1,)),
    "averaged_z": partial(changes.ranked, averaged=(2,)),
}
PREFERENCES = (0.0, 0.05, 0.1, 0.2, 0.4, 0.8, 1.2)
SHORT = {"max_picks": 25}  # episodes in which a load hardly changes
# Who watches such a policy, and how it learns.
PUPILS = {
    "taught": (unchanged, {}),
    "shuffled_taught": (changes.shuffled, {}),
    "averaged_taught": (unchanged, AVERAGED),
    "level_taught": (partial(changes.dug, preference=0.0), SHORT),
}
DUG = 0.4  # the preference that has dug the loads to one side

Change = Callable[[Training], None]


def _cell(change: Change = unchanged, seeds: int = SEEDS, **fields) -> Cell:
    return Cell(replace(CONFIG, **fields), range(FIRST_SEED, FIRST_SEED + seeds), change)


def _both(name: str, change: Change = unchanged, seeds: int = SEEDS, **fields) -> dict[str, Cell]:
    """A cell with the mask and one without it."""
    return {
        name: _cell(change, seeds, **fields),
        f"{name}_no_mask": _cell(change, seeds, mask=False, **fields),
    }


def _watching(change: Change) -> Change:
    """Only watch a network that chooses, and that learns with a change of its own."""
    return partial(changes.tandem, change=change, seed=50)


def _taught(change: Change, preference: float, **fields) -> Cell:
    """Only watch a policy that prefers a side, and picks one box in five at random."""
    both = change, partial(changes.taught, preference=preference)
    exploring = {"epsilon_init": 0.2, "epsilon_final": 0.2}
    change = partial(changes.several, makes=both)
    return _cell(change, FEW_SEEDS, picks=128_000, **exploring, **fields)


def _perfect(change: Change = unchanged) -> Cell:
    return _cell(partial(changes.perfect_start, change=change), FEW_SEEDS, epsilon_init=0.0)


CELLS: dict[str, Cell] = {
    **_both("ranks"),
    **_both("mirrored", changes.mirrored),
    **_both("shuffled", changes.shuffled, REMEDY_SEEDS),
    **_both("height_alone", partial(changes.see, change=changes.without), REMEDY_SEEDS),
    **_both("averaged", seeds=REMEDY_SEEDS, **AVERAGED),
    **_both("averaged_mirrored", changes.mirrored, **AVERAGED),
    **_both("positions", equalize=False),
    **{
        name: _cell(partial(changes.see, change=SEEN[name]), FEW_SEEDS, equalize=False)
        for name in ("averaged_x", "averaged_y", "averaged_z")
    },
    **{f"ranks_{name}": _cell(**fields) for name, fields in TAKEN_BACK.items()},
    **{
        f"shuffled_{name}": _cell(changes.shuffled, **fields) for name, fields in TAKEN_BACK.items()
    },
    **{f"episodes_{picks}": _cell(max_picks=picks) for picks in (25, 100, 250)},
    **_both("watching_shuffled", _watching(changes.shuffled)),
    "watching_ranks": _cell(_watching(unchanged)),
    "shuffled_watching_ranks": _cell(
        partial(changes.several, makes=(changes.shuffled, _watching(unchanged)))
    ),
    "perfect": _perfect(),
    "perfect_shuffled": _perfect(changes.shuffled),
    "perfect_successes": _perfect(partial(changes.successes_only, start=0)),
    **{
        f"{pupil}_{preference}": _taught(change, preference, **fields)
        for pupil, (change, fields) in PUPILS.items()
        for preference in PREFERENCES
    },
    "dug_to_y": _taught(partial(changes.dug, preference=DUG), 0.0, **SHORT),
    "dug_from_y": _taught(partial(changes.dug, preference=-DUG), 0.0, **SHORT),
    "untilted": _cell(changes.untilted),
    "untilted_y": _cell(partial(changes.untilted, axes=(1,))),
}
# Who chooses and who watches in the cells of two networks; the row of a run is of the one that
# watches, but for ``mean`` and ``end``, which are of the picks and so of the one that chooses.
WATCHING = {
    "watching_ranks": "ranks choose, ranks watch",
    "watching_shuffled": "shuffled places choose, ranks watch",
    "shuffled_watching_ranks": "ranks choose, shuffled places watch",
}
TRACED = ("ranks", "ranks_no_mask", "shuffled", "averaged", "positions")
EVERY = 16_000  # picks between the points of a trace: half an episode of all containers
JUDGED = [f"judged_{name}" for name in measures.BLANKED]
SLOPES, TILTS = ["slope_x", "slope_y", "slope_z"], ["tilt_x", "tilt_y"]
POINT = [
    "picks", "success_rate", *SLOPES, *TILTS, "wrong", "wrong_without_place", "height_of_wrong",
]  # fmt: skip
COLUMNS = ["cell", "seed", "mean", "end", *JUDGED, *SLOPES, *TILTS]
OPTIONS = {
    "--cells": {"nargs": "+", "metavar": "CELL", "choices": CELLS, "default": tuple(CELLS)},
    "--seeds": {"type": int, "help": "of each cell at most; those of the plan if not given"},
    **JOBS,
}


def train_in_laboratory(
    config: TrainConfig = CONFIG,
    change: Change = unchanged,
    watch: Callable[[Training], None] | None = None,
    every: int = EVERY,
) -> Training:
    """Train to the end, in this process and in memory alone.

    Args:
        config: of the run.
        change: made before its first pick.
        watch: is called with the run once in ``every`` picks, a multiple of ``num_envs``.

    Returns:
        The finished run.
    """
    with one_thread():
        run = Training(config, change=change)
        while not run.rollout.finished:
            run.step()
            # One step early, because the containers are full again after an episode's last pick.
            if watch is not None and (run.rollout.picks + config.num_envs) % every == 0:
                watch(run)
    return run


def point(run: Training, seen: measures.Seen | None = None) -> dict[str, float]:
    """What a trace says of a run at a moment: ``POINT``.

    Slopes and mistakes are those of its network in the containers as they stand, and so
    is the tilt; ``success_rate`` is the curve's last point.
    """
    network, observations = run.agent.network, run.rollout.observations
    liftable = run.rollout.envs.liftable()
    observations = observations if seen is None else seen(observations)
    values = [
        run.rollout.picks,
        run.curve.points[-1][2] if run.curve.points else np.nan,
        *measures.slopes(network, observations),
        *measures.tilt(observations, liftable),
        *measures.mistakes(network, observations, liftable),
    ]
    return dict(zip(POINT, map(float, values), strict=True))


def run_cell(name: str, cell: Cell, seed: int) -> dict:
    """Train and measure a run: a row of ``COLUMNS``, and the points of its trace."""
    config, trace, seen = replace(cell.config, seed=seed), [], SEEN.get(name)
    run = train_in_laboratory(config, cell.change, lambda run: trace.append(point(run, seen)))
    network, curve = run.agent.network, run.curve.table()
    row = {"cell": name, "seed": seed, "mean": curve["success_rate"].mean(), "end": end_msr(curve)}
    row |= measures.judged_blanked(network, config, seen)
    points = pd.DataFrame(trace)
    row |= points[SLOPES].iloc[-1].to_dict() | points[TILTS].mean().to_dict()
    return {"row": row, "trace": trace if name in TRACED else []}


def keep_cells(
    folder: Path, cells: Mapping[str, Cell], run: Callable[[str, Cell, int], dict], n_jobs: int
) -> list[Result]:
    """What ``run`` returns of each seed of some cells, see ``results.kept``."""
    jobs, same = [], {"measured": identity(run), "fingerprint": training_fingerprint()}
    for name, cell in cells.items():
        question = {"cell": name, "change": identity(cell.change), **same}
        for seed in cell.seeds:
            config = replace(cell.config, seed=seed).plain()
            jobs.append((question | config, partial(run, name, cell, seed)))
    return keep_all(folder, jobs, n_jobs)


def laboratory_data(
    cells: Sequence[str] = tuple(CELLS),
    seeds: int | None = None,
    folder: str | Path = paths.DATA,
    runs_dir: str | Path = paths.RUNS,
    n_jobs: int = -1,
) -> None:
    """Train the laboratory's cells; write ``falls/laboratory.csv`` and ``falls/trace.csv``.

    The first has a row per run: ``cell``, ``seed``; ``mean`` and ``end``, the MSR while training
    over all picks and over the last tenth; ``judged_as_is`` and ``judged_x``, ``judged_y``,
    ``judged_place``, the trained network's MSR in fresh containers, as it is and with x, y or
    both set to 0; its slopes at the end, and the mean ``tilt_x`` and ``tilt_y`` of the containers
    over the training (see ``measures``). The second has the points of the runs in ``TRACED``, see
    ``point``.

    A part of the ``cells``, or fewer ``seeds`` of each, goes to the folder ``reduced``.
    """
    chosen = {cell: CELLS[cell]._replace(seeds=CELLS[cell].seeds[:seeds]) for cell in cells}
    results = keep_cells(Path(runs_dir) / "laboratory", chosen, run_cell, n_jobs)
    rows = [result.value["row"] for result in results]
    traces = [
        pd.DataFrame(result.value["trace"]).assign(cell=row["cell"], seed=row["seed"])
        for row, result in zip(rows, results)
        if result.value["trace"]
    ]
    tables = {"laboratory": pd.DataFrame(rows)[COLUMNS]}
    if traces:
        tables["trace"] = pd.concat(traces)[["cell", "seed", *POINT]].astype({"picks": int})
    reduced = seeds is not None or set(cells) < set(CELLS)
    place = Path(folder) / ("reduced/falls" if reduced else "falls")
    command = f"{COMMAND} laboratory"
    settings, fingerprint = {"config": CONFIG.plain(), "runs": len(rows)}, training_fingerprint()
    publish(place, "laboratory", tables, command, settings, results, fingerprint, "%.4g", reduced)


def read_laboratory(folder: str | Path = paths.DATA) -> pd.DataFrame:
    """A row per run of the laboratory, see ``laboratory_data``."""
    return read_table(Path(folder) / "falls/laboratory.csv", f"{COMMAND} laboratory", COLUMNS)


def read_trace(folder: str | Path = paths.DATA) -> pd.DataFrame:
    """A row per point of a traced run, see ``point``."""
    columns = ["cell", "seed", *POINT]
    return read_table(Path(folder) / "falls/trace.csv", f"{COMMAND} laboratory", columns)
