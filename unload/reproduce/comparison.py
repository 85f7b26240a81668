"""Picking policies compared where the lift table reaches."""

import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import pandas as pd
from joblib import Parallel, delayed

from unload.agent.evaluation import Policy, evaluate
from unload.load.substacks import stack_load
from unload.reproduce.players import LEARNED, POLICIES, find_policy, policy_digest
from unload.support import checks, files
from unload.support.provenance import joined, run_record, write_provenance

LOADS, SEED = 100, 3000  # fresh containers for each policy and condition
CONDITIONS = {
    "500 picks": {},
    "complete": {"max_picks": None},
    "σ 0.5 cm": {"position_noise": 0.005},
    "σ 2 cm": {"position_noise": 0.02},
    "σ 5 cm": {"position_noise": 0.05},
    "boxes × 0.8": {"stack": partial(stack_load, scale=0.8)},
    "boxes × 1.2": {"stack": partial(stack_load, scale=1.2)},
}


def comparison_data(
    names: Sequence[str] = POLICIES,
    loads: int = LOADS,
    folder: str | Path = files.DATA,
    n_jobs: int = -1,
) -> None:
    """Let policies unload the same containers under each condition: ``comparison.csv``.

    One row per policy, condition and container, with the columns of ``compare``. The learned
    policies play twice, told which items have failed and not.

    Args:
        names: of the policies.
        loads: containers each.
        folder: of the data; it holds the learned policies.
        n_jobs: processes, as in joblib.

    Raises:
        FileNotFoundError: a policy's file is absent; the message names it.
        ValueError: an unknown policy.
    """
    checks.integer("loads", loads, 1)
    players = {name: find_policy(name, folder) for name in names}
    jobs = [
        delayed(compare)(name, players[name], mask, condition, loads)
        for condition in CONDITIONS
        for name in players
        for mask in ((True, False) if name in LEARNED else (True,))
    ]
    results = Parallel(n_jobs)(jobs)
    table = pd.concat([rows for rows, _ in results])
    text = table.to_csv(index=False, float_format="%.6g")
    files.write_text(Path(folder) / "comparison.csv", text)
    weights = {name: policy_digest(name, folder) for name in names}
    settings = {"policies": weights, "loads": loads, "seed": SEED}
    reduced = loads < LOADS or set(names) < set(POLICIES)
    record = joined(record for _, record in results)
    command = f"python -m unload.reproduce comparison --policies {' '.join(names)}"
    write_provenance(folder, "comparison", command, settings, reduced, record)


def compare(
    name: str, policy: Policy, mask: bool, condition: str, loads: int
) -> tuple[pd.DataFrame, dict]:
    """What ``evaluate`` tells of a policy under a condition.

    Returns:
        Its rows with the columns ``policy``, ``mask``, ``condition`` and ``load`` before them,
        and what ``run_record`` tells.
    """
    start = time.monotonic()
    table = evaluate(policy, loads, SEED, mask=mask, **CONDITIONS[condition])
    for place, (column, value) in enumerate(
        {"policy": name, "mask": mask, "condition": condition, "load": range(loads)}.items()
    ):
        table.insert(place, column, value)
    return table, run_record(time.monotonic() - start)
