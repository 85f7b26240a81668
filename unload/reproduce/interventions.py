"""Why do runs fall? Control runs of the plan, gone on with after 12 million picks with one change.

    python -m unload.reproduce interventions

The control is the cell ``paper_mask``. A run's state after 12 million picks is made once; each
change goes on from it. As soon as it has finished, it is published as
``data/answer/interventions/<change>/seed_<seed>.csv``, its weights and its provenance beside it.
"""

import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from tqdm import tqdm

from unload.agent.checkpoint import RunFolder
from unload.agent.config import TrainConfig
from unload.agent.replay import ReplayBuffer
from unload.agent.sweep import one_thread
from unload.agent.training import Training
from unload.agent.weights import load_policy, save_policy
from unload.reproduce.answer import CELLS, COLUMNS
from unload.reproduce.changes import CHANGES
from unload.reproduce.fingerprint import training_fingerprint
from unload.reproduce.results import COMMAND, JOBS, publish, read_table
from unload.support import checks, files
from unload.support.provenance import run_record

CONTROL = CELLS["paper_mask"]
START = 12_000_000  # picks before the change
SEEDS = (0, 2, 3, 4, 5)  # of control runs that have not fallen by then (deviation 10 of the plan)
FAILURES = "failures"  # column: share of failures in the replay
CONTROL_FOLDER, FOLDER = "control", "interventions"


OPTIONS = {
    "--changes": {"nargs": "+", "choices": CHANGES, "default": tuple(CHANGES)},
    "--seeds": {"nargs": "+", "type": int, "default": SEEDS},
    "--start": {"type": int, "default": START, "help": "picks before the change"},
    **JOBS,
}


def interventions_data(
    changes: Sequence[str] = tuple(CHANGES),
    seeds: Sequence[int] = SEEDS,
    start: int = START,
    config: TrainConfig = CONTROL,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = -1,
    progress: bool = True,
) -> None:
    """Go on with control runs, and publish each as soon as it has finished.

    What is kept, and where to go on when called again, stands in
    ``<runs_dir>/interventions/<fingerprint>/after_<start>/seed_<seed>/``: the control's state in
    ``control/checkpoint.npz``, as ``unload.train`` writes it, and each change in its folder.

    Args:
        changes: names in ``CHANGES``.
        seeds: of the control runs.
        start: picks before the change.
        config: of the control with seed 0.
        folder: of the data.
        runs_dir: where the runs are kept, apart from those of code that trained otherwise.
        n_jobs: processes, as in joblib.
        progress: show a progress bar.

    Raises:
        ValueError: an unknown change, or ``start`` is no step of the run.
        RuntimeError: runs failed; the message says which and why. The others are published.
    """
    for change in changes:
        checks.one_of("changes", change, CHANGES)
    if checks.integer("start", start, 1, config.picks) % config.num_envs:
        raise ValueError(f"start is {start}; expected a multiple of num_envs={config.num_envs}")
    fingerprint = training_fingerprint()
    places = {
        replace(config, seed=seed): place_of(runs_dir, fingerprint, start, seed) for seed in seeds
    }
    jobs = [(make_control, each, start, place) for each, place in places.items()]
    _all(jobs, n_jobs, progress)
    jobs = [
        (_make_change, each, start, place, change, Path(folder), fingerprint)
        for each, place in places.items()
        for change in changes
    ]
    _all(jobs, n_jobs, progress)


def _all(jobs: Sequence[tuple], n_jobs: int, progress: bool) -> None:
    """Carry out all jobs, a function and its arguments each; then report what went wrong."""
    errors = Parallel(n_jobs, return_as="generator_unordered", batch_size=1)(
        delayed(_error_of)(*job) for job in jobs
    )
    bar = {"total": len(jobs), "unit": "run", "disable": not progress, "ncols": 100}
    failed = [error for error in tqdm(errors, file=sys.stdout, **bar) if error]
    if failed:
        raise RuntimeError("\n".join(failed))


def _error_of(function: Callable, config: TrainConfig, start: int, place: Path, *rest) -> str:
    """Carry out one job; the error's text if it failed, so that the others go on."""
    try:
        with one_thread():
            function(config, start, place, *rest)
    except Exception as error:
        return f"{place}, {rest[:1]}: {type(error).__name__}: {error}"
    return ""


def place_of(runs_dir: str | Path, fingerprint: str, start: int, seed: int) -> Path:
    """The folder of a control run and of its changes after ``start`` picks."""
    return Path(runs_dir) / FOLDER / fingerprint / f"after_{start}" / f"seed_{seed}"


def make_control(config: TrainConfig, start: int, place: Path) -> None:
    """Train a control run as far as its change, in ``place``, or leave it as it is there."""
    folder = RunFolder(place / CONTROL_FOLDER)
    with folder.locked():
        run = Training(config)
        for _ in folder.restore(run):
            pass
        if run.rollout.picks < start:
            _train(run, start, lambda: folder.save(run))
            folder.save(run)
        run.rollout.close()


def _make_change(
    config: TrainConfig, start: int, place: Path, change: str, folder: Path, fingerprint: str
) -> None:
    """Go on with a control run after one change, and publish the result."""
    kept = RunFolder(place / change)
    with kept.locked():
        if not (kept.path / "record.json").exists():
            begin = time.monotonic()
            later = kept.path / "later.npz"
            run = changed(config, start, RunFolder(place / CONTROL_FOLDER), change)
            shares = _restore(run, later) if later.exists() else []
            _train(run, config.picks, lambda: _save(run, shares, later, start), shares)
            run.rollout.close()
            save_policy(run.policy(), kept.path / "policy.safetensors")
            table = run.curve.table()
            table[FAILURES] = np.append(np.full(len(table) - len(shares), np.nan), shares)
            files.write_text(kept.path / "curve.csv", table.to_csv(index=False))
            files.write_json(kept.path / "record.json", run_record(time.monotonic() - begin))
            later.unlink(missing_ok=True)
    name, folder = f"seed_{config.seed}", folder / "answer" / FOLDER / change
    save_policy(load_policy(kept.path / "policy.safetensors"), folder / f"{name}.safetensors")
    publish(
        folder,
        name,
        {name: pd.read_csv(kept.path / "curve.csv")[[*COLUMNS, FAILURES]]},
        f"{COMMAND} interventions --changes {change} --start {start}",
        asdict(config) | {"change": change, "start": start},
        config.picks < CONTROL.picks,
        [files.read_json(kept.path / "record.json")],
        fingerprint,
        "%.5g",
    )


def changed(config: TrainConfig, start: int, control: RunFolder, change: str) -> Training:
    """A control run after ``start`` picks, with one change made.

    Raises:
        ValueError: ``control`` holds no checkpoint of this run after ``start`` picks.
    """
    run = Training(config)
    for _ in control.restore(run):
        pass
    if run.rollout.picks != start:
        raise ValueError(f"{control.checkpoint} is of {run.rollout.picks} picks; expected {start}")
    CHANGES[change](run)
    return run


def _train(
    run: Training, until: int, save: Callable[[], None], shares: list[float] | None = None
) -> None:
    """Train as far as ``until`` picks; save now and then.

    ``shares`` is added to at each point of the curve: the share of failures in the replay.
    """
    saved = time.monotonic()
    while run.rollout.picks < until:
        run.step()
        if shares is not None and not run.curve.sums["picks"]:
            shares.append(failure_share(run.replay))
        if time.monotonic() - saved > run.config.checkpoint_interval:
            run.agent.check_finite()
            save()
            saved = time.monotonic()
    run.agent.check_finite()


def failure_share(replay: ReplayBuffer) -> float:
    """The share of failed picks in a replay memory."""
    return float((replay.arrays["rewards"][replay.filled()] < 0).mean())


def _save(run: Training, shares: list[float], path: Path, start: int) -> None:
    """Keep what has changed since ``start``; the replay is filled again by repeating the picks."""
    parts = {"agent": run.agent.state(), "curve": run.curve.state()}
    arrays = {
        f"{part}.{name}": value for part, state in parts.items() for name, value in state.items()
    }
    arrays |= {
        "actions": run.rollout.actions_since(start // run.config.num_envs),
        "digest": np.array(run.rollout.digest()),
        "shares": np.array(shares),
        "rng": np.array(json.dumps(run.rng.bit_generator.state)),
    }
    files.write_arrays(path, arrays)


def _restore(run: Training, path: Path) -> list[float]:
    """Let a run go on from what ``_save`` has kept; return the shares of failures so far.

    Raises:
        ValueError: the file is damaged, or its picks lead to other observations.
    """
    stored = files.read_arrays(path)
    checks.entries(str(path), stored, ("actions", "digest", "shares", "rng"))
    for actions in stored["actions"].astype(np.int64):
        run.replay.add(**run.rollout.pick(actions)[1])
    if run.rollout.digest() != stored["digest"]:
        raise ValueError(f"{path}: its picks lead to other observations; remove it to start anew")
    for part in ("agent", "curve"):
        prefix = f"{part}."
        state = {
            name.removeprefix(prefix): stored[name] for name in stored if name.startswith(prefix)
        }
        getattr(run, part).load_state(state)
    run.rng.bit_generator.state = json.loads(str(stored["rng"]))
    return stored["shares"].tolist()


def read_interventions(
    folder: str | Path = files.DATA,
) -> Iterator[tuple[str, int, pd.DataFrame]]:
    """Change, seed and curve of each published run, in the order of ``CHANGES``."""
    for change in CHANGES:
        command = f"{COMMAND} interventions --changes {change}"
        for path in sorted((Path(folder) / "answer" / FOLDER / change).glob("seed_*.csv")):
            seed = int(path.stem.removeprefix("seed_"))
            yield change, seed, read_table(path, command, [*COLUMNS, FAILURES])
