"""The laboratory: the fall of the paper's configuration in two seconds a run.

python -m unload.reproduce laboratory
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from unload.agent.config import TrainConfig
from unload.agent.sweep import one_thread
from unload.agent.training import Training, unchanged
from unload.reproduce.falls import measures
from unload.reproduce.falls.cells import CELLS, CONFIG, SEEN, TRACED, Change
from unload.reproduce.fingerprint import training_fingerprint
from unload.reproduce.results import COMMAND, JOBS, keep_all, publish, read_table
from unload.support import checks, files

EVERY = 16_000  # picks between the points of a trace: half an episode of all containers
END = 0.1  # share of the picks at the end of a run
JUDGED = [f"judged_{name}" for name in measures.BLANKED]
SLOPES, TILTS = ["slope_x", "slope_y", "slope_z"], ["tilt_x", "tilt_y"]
POINT = [
    "picks", "success_rate", *SLOPES, *TILTS, "height_spread", "place_spread",
    "wrong", "wrong_without_place", "height_of_wrong",
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
        The finished run, its environments closed.
    """
    with one_thread():
        run = Training(config)
        change(run)
        while not run.rollout.finished:
            run.step()
            # One step early, because the containers are full again after an episode's last pick.
            if watch is not None and (run.rollout.picks + config.num_envs) % every == 0:
                watch(run)
        run.rollout.close()
    return run


def end_msr(run: Training) -> float:
    """MSR while training over the last tenth of a finished run."""
    curve = run.curve.table()
    last = curve["picks"] > (1 - END) * run.config.picks
    return float(curve.loc[last, "success_rate"].mean())


def point(run: Training, seen: measures.Seen | None = None) -> dict[str, float]:
    """What a trace says of a run at a moment: ``POINT``.

    Slopes, spreads and mistakes are those of its network in the containers as they stand, and so
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
        *measures.spreads(network, observations),
        *measures.mistakes(network, observations, liftable),
    ]
    return dict(zip(POINT, map(float, values), strict=True))


def run_cell(cell: str, seed: int) -> dict:
    """Train and measure a run: a row of ``COLUMNS``, and the points of its trace."""
    config, trace = replace(CELLS[cell].config, seed=seed), []
    seen = SEEN.get(cell)
    run = train_in_laboratory(
        config, CELLS[cell].change, lambda run: trace.append(point(run, seen))
    )
    network = run.agent.network
    mean = run.curve.table()["success_rate"].mean()
    row = {"cell": cell, "seed": seed, "mean": mean, "end": end_msr(run)}
    for name, blank in zip(JUDGED, measures.BLANKED.values()):
        row[name] = measures.judged(network, config, blank, seen)
    points = pd.DataFrame(trace)
    row |= points[SLOPES].iloc[-1].to_dict() | points[TILTS].mean().to_dict()
    return {"row": row, "trace": trace if cell in TRACED else []}


def laboratory_data(
    cells: Sequence[str] = tuple(CELLS),
    seeds: int | None = None,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = -1,
    progress: bool = True,
) -> None:
    """Train the laboratory's cells; write ``falls/laboratory.csv`` and ``falls/trace.csv``.

    The first has a row per run: ``cell``, ``seed``; ``mean`` and ``end``, the MSR while training
    over all picks and over the last tenth; ``judged_as_is`` and ``judged_x``, ``judged_y``,
    ``judged_place``, the trained network's MSR in fresh containers, as it is and with x, y or
    both set to 0; its slopes at the end, and the mean
    ``tilt_x`` and ``tilt_y`` of the containers over the training (see ``measures``). The second
    has the points of the runs in ``TRACED``, see ``point``.

    Args:
        cells: names in ``CELLS``.
        seeds: of each cell at most, those of the plan if None.
        folder: of the data; a part of the cells or seeds goes to its folder ``reduced``.
        runs_dir: where finished runs are kept.
        n_jobs: processes, as in joblib.
        progress: show a progress bar.

    Raises:
        ValueError: an unknown cell.
    """
    for cell in cells:
        checks.one_of("cells", cell, CELLS)
    fingerprint, jobs = training_fingerprint(), []
    for cell in cells:
        for seed in CELLS[cell].seeds[:seeds]:
            config = asdict(replace(CELLS[cell].config, seed=seed))
            question = {"cell": cell, "fingerprint": fingerprint, **config}
            jobs.append((question, partial(run_cell, cell, seed)))
    results = keep_all(Path(runs_dir) / "laboratory", jobs, n_jobs, progress)
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
    publish(
        Path(folder) / ("reduced/falls" if reduced else "falls"),
        "laboratory",
        tables,
        f"{COMMAND} laboratory",
        {"config": asdict(CONFIG), "runs": len(rows)},
        reduced,
        [result.record for result in results],
        fingerprint,
        "%.4g",
    )


def read_laboratory(folder: str | Path = files.DATA) -> pd.DataFrame:
    """A row per run of the laboratory, see ``laboratory_data``."""
    return read_table(Path(folder) / "falls/laboratory.csv", f"{COMMAND} laboratory", COLUMNS)


def read_trace(folder: str | Path = files.DATA) -> pd.DataFrame:
    """A row per point of a traced run, see ``point``."""
    columns = ["cell", "seed", *POINT]
    return read_table(Path(folder) / "falls/trace.csv", f"{COMMAND} laboratory", columns)
