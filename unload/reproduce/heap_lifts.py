"""Single lifts from heaps: whether disorder alone makes picking hard.

    python -m unload.reproduce heap-lifts         # data/heap/lifts.csv

The paper's pick, one box upwards, by rules that need no learning. Each episode is kept in
``runs/heap``. It takes 12 minutes of CPU.
"""

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from unload import task
from unload.heap.env import MAX_PICKS, stored_heaps
from unload.heap.episodes import play
from unload.heap.lift import LiftEnv
from unload.heap.rules import RULES
from unload.reproduce.heap import CONSTANTS, HEAPS, NAME
from unload.reproduce.intervals import mean_interval, share_interval
from unload.reproduce.results import COMMAND, JOBS, keep_all, publish
from unload.support import checks, files

PHYSICS = "whole"


def lifts_data(
    heaps: int = HEAPS["test"],
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = 1,
    progress: bool = True,
) -> pd.DataFrame:
    """Let every rule lift boxes from the unseen heaps; write ``heap/lifts.csv``.

    Returns:
        One row per rule and heap: ``policy``, ``heap``, ``lifts``, ``success_rate`` and
        ``falls``, other boxes that dropped by more than 0.5 m, per lift.
    """
    checks.integer("heaps", heaps, 1, HEAPS["test"])
    places = [(name, number) for name in RULES for number in range(heaps)]
    stored = stored_heaps("test")
    lift = task.PICK_FORCE, task.LIFT_TIME, task.LIFT_THRESHOLD
    jobs = [
        (
            {
                "lifts": name,
                "heap": stored[number].digest(),
                "number": number,
                "physics": PHYSICS,
                "constants": [*CONSTANTS, *lift],
                "picks": MAX_PICKS,
            },
            partial(_lifts, name, number),
        )
        for name, number in places
    ]
    answers = keep_all(Path(runs_dir) / NAME / "lifts", jobs, n_jobs, progress)
    frame = pd.DataFrame(
        {
            "policy": name,
            "heap": number,
            "lifts": len(answer.value["came"]),
            "success_rate": np.mean(answer.value["came"]),
            "falls": np.mean(answer.value["falls"]),
        }
        for (name, number), answer in zip(places, answers)
    )
    settings = {"heaps": heaps, "physics": PHYSICS, "picks": MAX_PICKS}
    records = [answer.record for answer in answers]
    command, reduced = f"{COMMAND} heap-lifts --heaps {heaps}", heaps < HEAPS["test"]
    publish(Path(folder) / NAME, "lifts", {"lifts": frame}, command, settings, reduced, records)
    return frame


def _lifts(name: str, number: int) -> dict[str, list]:
    heap = stored_heaps("test")[number]
    env = LiftEnv(heaps=[heap], physics=PHYSICS)
    try:
        episode = play(env, RULES[name], heap, seed=number)
    finally:
        env.close()
    return {"came": episode.unloaded.tolist(), "falls": episode.falls.tolist()}


OPTIONS = JOBS | {"--heaps": {"type": int, "default": HEAPS["test"], "help": "heaps to unload"}}


def success_rates(lifts: pd.DataFrame) -> pd.DataFrame:
    """Mean success rate of each rule, ``success``, with the ends of its 95 % interval.

    A BCa bootstrap interval over heaps; where no lift has failed, it would have no width, and
    the Clopper–Pearson interval of the number of lifts stands for it, as if they were
    independent.

    Args:
        lifts: see ``lifts_data``.
    """
    rows = {}
    for name, of in lifts.groupby("policy", sort=False):
        mean, low, high = mean_interval(of["success_rate"])
        if mean == 1:
            low, high = share_interval(of["lifts"].sum(), of["lifts"].sum())
        rows[name] = {"success": mean, "success_low": low, "success_high": high}
    return pd.DataFrame(rows).T


PARTS = {"heap-lifts": ("single lifts from heaps", lifts_data, OPTIONS)}
