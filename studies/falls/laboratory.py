"""The laboratory: the fall of the paper's configuration in two seconds a run.

    python -m studies laboratory
    python -m studies fresh

How its cells are trained and measured, and when a preference becomes a mistake.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pandas as pd

from studies import changes
from studies.falls import measures
from studies.falls.cells import CELLS, CONFIG, FRESH, SEEN, Change
from studies.fingerprint import training_fingerprint
from studies.grid import Cell
from studies.results import COMMAND, Result, code_of, keep_all, publish, write_table
from studies.statistics import end_msr
from studies.sweep import one_thread
from unload.agent.config import TrainConfig
from unload.agent.training import Training

TRACED = ("ranks", "shuffled")
EVERY = 16_000  # picks between the points of a trace: half an episode of all containers
SLOPES, TILTS = ["slope_x", "slope_y", "slope_z"], ["tilt_x", "tilt_y"]
TRACE = ["picks", "success_rate", *SLOPES, *TILTS]
POINT = [*TRACE, "wrong", "wrong_without_place", "height_of_wrong"]
COLUMNS = ["cell", "seed", "mean", "end", "judged_as_is", *SLOPES]
FRESH_COLUMNS = ["cell", "seed", "end", "judged_as_is", "judged_averaged_x", *SLOPES]
# Preferences along x and y above which a network errs, fitted on 290 networks, of which 190 are in
# ``CELLS`` today; the runs of the others stand at revision ba9d78d1.
THRESHOLDS = 0.22, 0.42
ERRS = 0.95  # MSR in fresh containers below which a network errs


def train_in_laboratory(
    config: TrainConfig = CONFIG,
    change: Change = None,
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
        run = Training(config, change=change)
        while not run.rollout.finished:
            run.step()
            # One step early, because the containers are full again after an episode's last pick.
            if watch is not None and (run.rollout.picks + config.num_envs) % every == 0:
                watch(run)
        run.rollout.close()  # a change may tie the run in a circle, which frees nothing by itself
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


@cache
def taught_preference(teacher: float, seed: int = 0) -> float:
    """The preference along y that a pupil learns.

    A teacher picks the highest z + ``teacher`` · y of ranks, and a fifth of the boxes at random; a
    fresh network, its pupil, learns from these 128,000 picks and never chooses.

    Args:
        teacher: the preference of the teacher along y.
        seed: of the run.
    """
    learned: list[np.ndarray] = []

    def note(run: Training) -> None:
        learned.append(measures.slopes(run.agent.network, run.rollout.observations))

    config = replace(CELLS["taught_0.0"].config, seed=seed)
    train_in_laboratory(config, partial(changes.taught, preference=teacher), note)
    _, along_y, upward = learned[-1]
    return float(along_y / abs(upward))


def run_cell(name: str, cell: Cell, seed: int) -> dict:
    """Train and measure a run: a row of all columns that are published, and its trace's points."""
    config, trace, seen = replace(cell.config, seed=seed), [], SEEN.get(name)
    named = {"cell": name, "seed": seed}
    run = train_in_laboratory(
        config, cell.change, lambda run: trace.append(named | point(run, seen))
    )
    network, curve = run.agent.network, run.curve.table()
    row = named | {"mean": curve["success_rate"].mean(), "end": end_msr(curve)}
    row["judged_as_is"] = measures.judged(network, config, seen=seen)
    positions = replace(config, equalize=False)  # they are ranked after the environment
    row["judged_averaged_x"] = measures.judged(network, positions, seen=SEEN["averaged_x"])
    row |= {slope: trace[-1][slope] for slope in SLOPES}
    return {"row": row, "trace": trace if name in TRACED else []}


def keep_cells(
    place: str, cells: Mapping[str, Cell], n_jobs: int, compute: Callable[..., dict] = run_cell
) -> list[Result]:
    """What ``compute`` returns of the name, the cell and each seed of some cells, see ``kept``."""
    asked = []
    for name, cell in cells.items():
        question = {"cell": name, "change": code_of(cell.change)}
        for seed in cell.seeds:
            config = replace(cell.config, seed=seed).plain()
            asked.append((question | config, (name, cell, seed)))
    return keep_all(place, compute, asked, n_jobs)


def laboratory_data(n_jobs: int = -1) -> None:
    """Train the laboratory's cells; write ``falls/laboratory.csv`` and ``falls/trace.csv``.

    The first has a row per run: ``cell``, ``seed``; ``mean`` and ``end``, the MSR while training
    over all picks and over the last tenth; ``judged_as_is``, the trained network's MSR in fresh
    containers; and its slopes at the end (see ``measures``). The second has of the points of the
    runs in ``TRACED`` what is in ``TRACE``, see ``point``.
    """
    results = keep_cells("laboratory", CELLS, n_jobs)
    trace = pd.DataFrame([point for result in results for point in result.value["trace"]])
    trace = trace[["cell", "seed", *TRACE]].astype({"picks": int})
    write_table("falls/trace", trace, "%.4g")
    rows = pd.DataFrame([result.value["row"] for result in results])[COLUMNS]
    publish_cells("falls/laboratory", "laboratory", rows, results)


def fresh_data(n_jobs: int = -1) -> None:
    """Train the cells of the third plan; write ``falls/fresh.csv``, a row per run.

    Its columns are those of ``falls/laboratory.csv`` but for ``mean``, and ``judged_averaged_x``:
    the MSR in fresh containers if equal x share one rank when the trained network chooses.
    """
    results = keep_cells("fresh", FRESH, n_jobs)
    rows = pd.DataFrame([result.value["row"] for result in results])[FRESH_COLUMNS]
    publish_cells("falls/fresh", "fresh", rows, results)


def publish_cells(
    name: str,
    part: str,
    rows: pd.DataFrame,
    results: list[Result],
    config: TrainConfig = CONFIG,
    float_format: str = "%.4g",
    **settings: int,
) -> None:
    """Write rows of a laboratory's runs, which a part makes of ``results``, and their provenance.

    Its settings are the configuration that the cells change, and what else the rows depend on.
    """
    settings = {"config": config.plain(), "runs": len(rows), **settings}
    tables, command = {name.rpartition("/")[2]: rows}, f"{COMMAND} {part}"
    publish(name, tables, command, settings, results, training_fingerprint(), float_format)


def preferences(table: pd.DataFrame) -> pd.DataFrame:
    """The preferences of networks along ``x`` and ``y``, by their ``SLOPES``."""
    along = table[["slope_x", "slope_y"]].div(table["slope_z"].abs(), axis=0)
    return along.set_axis(["x", "y"], axis=1)


def predicted(table: pd.DataFrame, config: TrainConfig = CONFIG) -> pd.Series:
    """Whether each network errs, by its preferences alone.

    Where equal x share one rank, a preference along x cannot put a box before the one on it.

    Args:
        table: with ``SLOPES``.
        config: of the runs.
    """
    along, (along_x, along_y) = preferences(table).abs(), THRESHOLDS
    side = along["y"] > along_y
    return side if config.ties == "average" else side | (along["x"] > along_x)
