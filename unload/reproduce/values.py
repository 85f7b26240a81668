"""Which values runs give to liftable and to blocked items, before a fall and after it.

    python -m unload.reproduce values

Control runs of the plan go on after 12 million picks, with one change or none (deviations 19 to 21
of the plan). The states of the first episode are kept at five moments, with the outcome of a pick
of each item; the values of these items are followed, episode by episode.
"""

from collections import deque
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import asdict, replace
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import torch
from joblib import Parallel, delayed

from unload.agent.checkpoint import RunFolder
from unload.agent.config import TrainConfig
from unload.agent.greedy import greedy_actions
from unload.agent.sweep import one_thread
from unload.agent.training import Training
from unload.reproduce.changes import CHANGES
from unload.reproduce.fingerprint import training_fingerprint
from unload.reproduce.interventions import (
    CONTROL,
    CONTROL_FOLDER,
    FAILURES,
    SEEDS,
    START,
    changed,
    failure_share,
    make_control,
    place_of,
)
from unload.reproduce.results import COMMAND, JOBS, keep_all, publish, read_table
from unload.reproduce.verdict import falls, windows
from unload.support import checks, files

NAME = "values"
TRACED = (
    "nothing", "successes_kept", "failures_kept", "successes_called_failures", "ties_averaged"
)  # fmt: skip
FRESH = range(10, 18)  # of control runs that deviation 20 of the plan adds
FRESHER = (18, 19, 20, 22, 23)  # of those that deviation 21 adds
RUNS = [*product(TRACED, SEEDS), *(("nothing", seed) for seed in (*FRESH, *FRESHER))]
UNTIL = 15_000_000  # picks
MOMENTS = 5  # of an episode
PAST = 8  # episodes, a quarter of a million picks
MEASURES = ["liftable", "blocked", "wrong"]
COLUMNS = [
    "change", "seed", "picks", "success_rate", FAILURES,
    *MEASURES, *(f"own_{name}" for name in MEASURES), "start_wrong", "past_wrong",
]  # fmt: skip
OPTIONS = JOBS


def values_data(
    runs: Sequence[tuple[str, int]] = RUNS,
    start: int = START,
    until: int = UNTIL,
    config: TrainConfig = CONTROL,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = -1,
    progress: bool = True,
) -> None:
    """Trace the values in control runs with and without changes; write ``answer/values.csv``.

    A row is an episode, see ``trace``. Runs that have fallen before the change are left out.

    Args:
        runs: pairs of a change, a name in ``CHANGES``, and the seed of a control run.
        start: picks before the change.
        until: picks at which a trace ends, at most ``config.picks``.
        config: of the control with seed 0.
        folder: of the data.
        runs_dir: where the control runs and finished traces are kept.
        n_jobs: processes, as in joblib.
        progress: show a progress bar.

    Raises:
        ValueError: an unknown change, or ``until`` lies outside the run.
    """
    for change, _ in runs:
        checks.one_of("runs", change, CHANGES)
    checks.integer("until", until, start + config.num_envs * config.max_picks, config.picks)
    fingerprint = training_fingerprint()
    places = {seed: place_of(runs_dir, fingerprint, start, seed) for _, seed in runs}
    Parallel(n_jobs)(
        delayed(make_control)(replace(config, seed=seed), start, place)
        for seed, place in places.items()
    )
    settings = {"start": start, "until": until, "moments": MOMENTS, "past": PAST}
    jobs = []
    for change, seed in runs:
        traced = replace(config, seed=seed)
        question = {"change": change, **asdict(traced), **settings, "fingerprint": fingerprint}
        jobs.append((question, partial(_trace, traced, start, until, places[seed], change)))
    answers = keep_all(Path(runs_dir) / NAME, jobs, n_jobs, progress)
    tables = [
        pd.DataFrame(answer.value).assign(change=change, seed=seed)
        for answer, (change, seed) in zip(answers, runs)
        if answer.value
    ]
    publish(
        Path(folder) / "answer",
        NAME,
        {NAME: pd.concat(tables)[COLUMNS]},
        f"{COMMAND} {NAME}",
        asdict(config) | settings | {"runs": list(runs)},
        until < UNTIL or set(runs) < set(RUNS),
        [answer.record for answer in answers],
        fingerprint,
        "%.5g",
    )


def _trace(config: TrainConfig, start: int, until: int, place: Path, change: str) -> list[dict]:
    with one_thread():
        run = changed(config, start, RunFolder(place / CONTROL_FOLDER), change)
        try:
            fallen = falls(windows(run.curve.table())["success_rate"])
            return [] if fallen else trace(run, until)
        finally:
            run.rollout.close()


def trace(run: Training, until: int) -> list[dict[str, float]]:
    """Train on to ``until`` picks or a little more; return one row per episode.

    Args:
        run: at the beginning of an episode, the same one in all its containers.
        until: picks.

    Returns:
        ``picks`` at the episode's end, its ``success_rate``, and ``failures``, their share in the
        replay memory. Of the network at its end, on the states of the first episode: the mean
        values of ``liftable`` and of ``blocked`` items, and ``wrong``, the share of states in
        which the highest value is a blocked item's. The same on the episode's own states:
        ``own_liftable``, ``own_blocked``, ``own_wrong``. Of the network with which ``run`` came,
        on the episode's own states: ``start_wrong``. Of the network at the episode's end, on the
        states of the episode a quarter of a million picks ago: ``past_wrong``, NaN before that.

    Raises:
        ValueError: ``run`` stands within an episode.
    """
    length, first, rows = run.config.max_picks, None, []
    start, past = deepcopy(run.agent.network), deque(maxlen=PAST + 1)
    if run.rollout.steps % length:
        raise ValueError(f"run has made {run.rollout.steps} steps; expected whole episodes")
    while run.rollout.picks < until:
        begin, moments = run.rollout.picks, []
        for step in range(length):
            if step % (length // MOMENTS) == length // MOMENTS // 2:
                moments.append((run.rollout.observations, run.rollout.envs.liftable()))
            run.step()
        own = [np.concatenate(parts) for parts in zip(*moments)]
        first = first or own
        past.append(own)
        curve = run.curve.table()
        row = {
            "picks": run.rollout.picks,
            "success_rate": curve.loc[curve["picks"] > begin, "success_rate"].mean(),
            FAILURES: failure_share(run.replay),
            **measures(run.agent.network, *first),
        }
        found = measures(run.agent.network, *own)
        row |= {f"own_{name}": value for name, value in found.items()}
        row["start_wrong"] = wrong_share(start, *own)
        full = len(past) > PAST
        row["past_wrong"] = wrong_share(run.agent.network, *past[0]) if full else np.nan
        rows.append(row)
    return rows


def measures(
    network: torch.nn.Module, observations: np.ndarray, liftable: np.ndarray
) -> dict[str, float]:
    """Return what a network says about some states.

    Args:
        network: action values of observations.
        observations: (k, items, 3) float32, with an item in each row.
        liftable: (k, items) bool, which items would be unloaded if picked.

    Returns:
        ``liftable``, ``blocked`` and ``wrong``, see ``trace``.
    """
    with torch.no_grad():
        values = network(torch.from_numpy(observations)).numpy().astype(float)
    return {
        "liftable": float(values[liftable].mean()),
        "blocked": float(values[~liftable].mean()),
        "wrong": wrong_share(network, observations, liftable),
    }


def wrong_share(network: torch.nn.Module, observations: np.ndarray, liftable: np.ndarray) -> float:
    """Return the share of states in which a network's highest value is a blocked item's.

    Args:
        network, observations, liftable: see ``measures``.
    """
    best = greedy_actions(network, observations, np.ones_like(liftable))
    return float((~liftable[np.arange(len(best)), best]).mean())


def read_values(folder: str | Path = files.DATA) -> pd.DataFrame:
    """The table that ``values_data`` has written.

    Raises:
        FileNotFoundError: it has not been made.
        ValueError: it has other columns.
    """
    return read_table(Path(folder) / "answer" / f"{NAME}.csv", f"{COMMAND} {NAME}", COLUMNS)
