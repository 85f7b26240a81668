"""Why 60 %? The runs of the plan in ``data/answer/PLAN.md``, each as long as the paper's.

    python -m unload.reproduce answer

A cell is a configuration, trained with several seeds. Each run is published as soon as it has
finished, as ``data/answer/<cell>/seed_<seed>.csv`` (one row per episode of all environments),
its weights and its provenance beside it.
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path

import pandas as pd
from joblib import Parallel, delayed
from tqdm import tqdm

from unload.agent.checkpoint import RunFolder
from unload.agent.config import TrainConfig
from unload.agent.sweep import run_all
from unload.agent.weights import save_policy
from unload.reproduce import training
from unload.reproduce.fingerprint import training_fingerprint
from unload.reproduce.results import COMMAND, JOBS, publish, read_table
from unload.reproduce.study import BASE
from unload.support import checks, files
from unload.support.provenance import read_provenance

COLUMNS = ["picks", "success_rate", "deadlocked", "loss"]
MASKED = replace(BASE, mask=True)
AS_TRAINED = "paper_b2048_no_mask"  # the cell whose runs are those of ``training``


def _both(name: str, **changes) -> dict[str, TrainConfig]:
    """The cells of a change, without and with the mask in training."""
    return {
        f"{name}_{'mask' if mask else 'no_mask'}": replace(BASE, mask=mask, **changes)
        for mask in (False, True)
    }


# Cell → its configuration with seed 0.
CELLS: dict[str, TrainConfig] = {
    **_both("paper"),
    AS_TRAINED: training.CONFIG,
    "paper_b2048_mask": replace(MASKED, batch_size=2048),
    **_both("memory_22", replay_size=2**22),
    **_both("memory_23", replay_size=2**23),
    **_both("ties_averaged", ties="average"),
    **_both("positions", equalize=False),
    **_both("ties_by_order", position_noise=0.0),
    **_both("ties_by_drift", drift="settled"),
    **_both("failures_kept", failures_kept=0.5),
    # What the paper leaves open: with the mask, whose cell comes nearer to 60 %.
    "updates_4_mask": replace(MASKED, gradient_steps=4),  # one per 16 picks
    "updates_16_mask": replace(MASKED, gradient_steps=16),  # one per 4 picks
    "features_16_mask": replace(MASKED, n_features=16),
    "features_256_mask": replace(MASKED, n_features=256),
    "literal_mask": replace(MASKED, literal=True),
    "staggered_mask": replace(MASKED, staggered=True),
    "b2048_ties_averaged_mask": replace(MASKED, batch_size=2048, ties="average"),
}
# The paper's cells, as text and figures name them.
PAPER_CELLS = {
    "paper_no_mask": "without the mask, b = 256",
    "paper_mask": "with the mask, b = 256",
    "paper_b2048_no_mask": "without the mask, b = 2048",
    "paper_b2048_mask": "with the mask, b = 2048",
}
# Planned seeds of a cell; of those that are not listed, 5.
SEEDS = {
    "paper_no_mask": 10,
    "paper_mask": 10,
    "paper_b2048_no_mask": 8,
    "paper_b2048_mask": 8,
    "failures_kept_no_mask": 10,
    "failures_kept_mask": 10,
    "ties_averaged_mask": 10,
    "b2048_ties_averaged_mask": 10,
}
OPTIONS = {
    "--cells": {"nargs": "+", "choices": CELLS, "default": tuple(CELLS)},
    "--seeds": {"nargs": "+", "type": int, "help": "those of the plan if none are given"},
    **JOBS,
}


def seeds_of(cell: str) -> range:
    """Return the planned seeds of a cell."""
    return range(SEEDS.get(cell, 5))


def answer_data(
    cells: Sequence[str] = tuple(CELLS),
    seeds: Sequence[int] | None = None,
    picks: int = BASE.picks,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = -1,
    progress: bool = True,
) -> None:
    """Train the runs of some cells, and publish each as soon as it has finished.

    Args:
        cells: names in ``CELLS``.
        seeds: of the runs; those of the plan if None.
        picks: of each run.
        folder: of the data.
        runs_dir: where the runs are kept, apart from those of code that trained otherwise.
        n_jobs: processes, as in joblib.
        progress: show a progress bar.

    Raises:
        ValueError: an unknown cell.
        RuntimeError: runs failed; the message says which and why. The others are published.
        BrokenProcessPool: a process died. When called again, the runs under way are resumed.
    """
    for cell in cells:
        checks.one_of("cells", cell, CELLS)
    configs = {
        f"{cell}/seed_{seed}": replace(CELLS[cell], picks=picks, seed=seed)
        for cell in cells
        for seed in (seeds_of(cell) if seeds is None else seeds)
    }
    fingerprint = training_fingerprint()
    folder = Path(folder) / "answer"
    errors = Parallel(n_jobs, return_as="generator_unordered", batch_size=1)(
        delayed(_run)(name, config, Path(runs_dir), folder, fingerprint)
        for name, config in configs.items()
    )
    bar = {"total": len(configs), "unit": "run", "disable": not progress, "ncols": 100}
    failed = [error for error in tqdm(errors, file=sys.stdout, **bar) if error]
    if failed:
        raise RuntimeError("\n".join(failed))


def _run(name: str, config: TrainConfig, runs_dir: Path, folder: Path, fingerprint: str) -> str:
    """Train a run and publish it; what went wrong, or empty, so that the others go on."""
    run, kept = name, runs_dir / "answer" / fingerprint
    if name.startswith(f"{AS_TRAINED}/"):
        run = name.removeprefix(f"{AS_TRAINED}/")
        kept = training.runs_folder(runs_dir, fingerprint, config.picks)
    try:
        run_all({run: config}, kept, n_jobs=1, progress=False)
    except RuntimeError as error:
        return str(error)
    publish_run(name, config, kept / run, folder, fingerprint)
    return ""


def publish_run(name: str, config: TrainConfig, run: Path, folder: Path, fingerprint: str) -> None:
    """Publish a finished run: its curve, weights and provenance.

    Args:
        name: ``<cell>/seed_<seed>``.
        config: of the run.
        run: its folder.
        folder: of the data.
        fingerprint: of the training that made the run, see ``training_fingerprint``.
    """
    cell, _, file = name.rpartition("/")
    policy, curve = RunFolder(run).result(config)
    save_policy(policy, folder / cell / f"{file}.safetensors")
    publish(
        folder / cell,
        file,
        {file: training.episode_means(curve)[COLUMNS]},
        f"{COMMAND} answer --cells {cell}",
        asdict(config),
        config.picks < BASE.picks,
        [files.read_json(run / "record.json")],
        fingerprint,
        "%.5g",
    )


def read_answer(folder: str | Path = files.DATA) -> Iterator[tuple[str, int, pd.DataFrame]]:
    """Cell, seed and curve of each published run, in the order of ``CELLS``."""
    for cell in CELLS:
        for path in sorted((Path(folder) / "answer" / cell).glob("seed_*.csv")):
            seed = int(path.stem.removeprefix("seed_"))
            yield cell, seed, read_table(path, f"{COMMAND} answer --cells {cell}", COLUMNS)


def paper_runs(folder: str | Path = files.DATA) -> list[tuple[str, int, pd.DataFrame]]:
    """Cell, seed and curve of each published run of the paper's cells."""
    return [run for run in read_answer(folder) if run[0] in PAPER_CELLS]


def wall_minutes(batch_size: int, folder: str | Path = files.DATA) -> list[float]:
    """Recorded wall time in minutes of each published run of the paper's cells with a batch."""
    return [
        read_provenance(Path(folder) / "answer" / cell, f"seed_{seed}")["wall_time_s"] / 60
        for cell, seed, _ in paper_runs(folder)
        if CELLS[cell].batch_size == batch_size
    ]
