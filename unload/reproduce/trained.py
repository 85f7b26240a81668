"""What the runs of the plan have learned, on fresh containers.

    python -m unload.reproduce trained

A trained policy no longer explores nor learns. Each is measured with the mask and without it,
whichever it was trained with.
"""

from collections.abc import Collection
from functools import partial
from hashlib import blake2b
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from unload.agent.weights import load_policy
from unload.reproduce.answer import CELLS, read_answer
from unload.reproduce.fingerprint import training_fingerprint
from unload.reproduce.measure import LOADS_SEED, POLICY_LOADS, on_fresh_loads
from unload.reproduce.results import COMMAND, JOBS, keep_all, publish, read_table
from unload.reproduce.study import BASE
from unload.support import checks, files
from unload.support.provenance import read_provenance

NAME = "trained"
COLUMNS = ["cell", "seed", "msr_mask", "lowest_mask", "msr_no_mask", "lowest_no_mask"]
# Cells whose positions are seen as in fresh containers; the others are about how they are seen.
CELLS_MEASURED = [
    cell
    for cell, config in CELLS.items()
    if (config.position_noise, config.drift) == (BASE.position_noise, BASE.drift)
]
OPTIONS = JOBS


def trained_data(
    loads: int = POLICY_LOADS,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = -1,
    progress: bool = True,
) -> None:
    """Measure the policies of the published runs: ``answer/trained.csv``.

    One row per run: ``cell``, ``seed``; ``msr_mask`` and ``msr_no_mask``, the trained policy's MSR
    with the mask and without it; ``lowest_mask`` and ``lowest_no_mask``, the lowest success rate
    in any container.

    Args:
        loads: fresh containers for each policy, 500 picks in each.
        folder: of the data; it holds the runs.
        runs_dir: where what has been measured is kept.
        n_jobs: processes, as in joblib.
        progress: show a progress bar.

    Raises:
        ValueError: ``loads`` is not positive, or a run is of training that differs from today's.
        FileNotFoundError: no run has been published.
    """
    checks.integer("loads", loads, 1)
    fingerprint = training_fingerprint()
    policies = published_policies(CELLS_MEASURED, fingerprint, folder)
    jobs = [
        (
            {"weights": each.weights, "loads": loads, "seed": LOADS_SEED},
            partial(measure_policy, each.path, loads),
        )
        for each in policies
    ]
    answers = keep_all(Path(runs_dir) / NAME, jobs, n_jobs, progress)
    rows = [(each.cell, each.seed, *answer.value) for each, answer in zip(policies, answers)]
    publish(
        Path(folder) / "answer",
        NAME,
        {NAME: pd.DataFrame(rows, columns=COLUMNS)},
        f"{COMMAND} {NAME}",
        {"loads": loads, "loads_seed": LOADS_SEED},
        loads < POLICY_LOADS,
        [answer.record for answer in answers],
        fingerprint,
    )


class PublishedPolicy(NamedTuple):
    """The weights of a published run, and where they are.

    Attributes:
        cell, seed: of the run.
        path: of the weights.
        weights: their digest, which says whether what was measured of them still holds.
    """

    cell: str
    seed: int
    path: Path
    weights: str


def published_policies(
    cells: Collection[str], fingerprint: str, folder: str | Path = files.DATA
) -> list[PublishedPolicy]:
    """The trained policies of some cells, in the order of ``CELLS``.

    Args:
        cells: names in ``CELLS``.
        fingerprint: of the training that the runs must have.
        folder: of the data.

    Raises:
        ValueError: a run has another fingerprint.
        FileNotFoundError: no run has been published.
    """
    place, found = Path(folder) / "answer", []
    for cell, seed, _ in read_answer(folder):
        if cell not in cells:
            continue
        of_run = read_provenance(place / cell, f"seed_{seed}").get("fingerprint")
        if of_run != fingerprint:
            raise ValueError(
                f"{place / cell}/seed_{seed} has the fingerprint {of_run}; expected {fingerprint}"
            )
        path = place / cell / f"seed_{seed}.safetensors"
        weights = blake2b(path.read_bytes(), digest_size=16).hexdigest()
        found.append(PublishedPolicy(cell, seed, path, weights))
    if not found:
        raise FileNotFoundError(f"{place} holds no run; {COMMAND} answer makes them")
    return found


def measure_policy(path: str | Path, loads: int) -> list[float]:
    """Mean and lowest success rate of a stored policy, with the mask and then without it."""
    policy = load_policy(path)
    tables = [on_fresh_loads(policy, loads, mask) for mask in (True, False)]
    return [rate for each in tables for rate in each["success_rate"].agg(["mean", "min"])]


def read_trained(folder: str | Path = files.DATA) -> pd.DataFrame:
    """The table of ``trained_data``."""
    return read_table(Path(folder) / "answer" / f"{NAME}.csv", f"{COMMAND} {NAME}", COLUMNS)
