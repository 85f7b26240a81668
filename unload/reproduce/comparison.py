"""Picking policies compared where the lift table reaches.

    python -m unload.reproduce comparison

Rules and learned policies unload the same containers: in the conditions of the training, with
blurred positions, and with boxes of other sizes.
"""

from collections.abc import Sequence
from functools import partial
from hashlib import blake2b
from pathlib import Path

import pandas as pd
from joblib import Parallel, delayed

from unload.agent import policies
from unload.agent.evaluation import Policy, evaluate
from unload.agent.weights import load_policy
from unload.load.substacks import stack_load
from unload.reproduce.results import COMMAND, JOBS, measured, publish
from unload.support import checks, files
from unload.support.provenance import read_provenance

SIMPLE = {"random": policies.random, "nearest": policies.nearest, "highest": policies.highest}
# Learned policy → the data that it was trained with. Trainings of the paper's configuration
# end in two ways: one of each is compared.
LEARNED = {"paper": "training", "paper_seed_2": "training", "recommended": "study/recommended"}
COMPARED = (*SIMPLE, *LEARNED)
COMPARISON_LOADS, SEED = 100, 3000  # fresh containers for each policy and condition
CONDITIONS = {
    "500 picks": {},
    "complete": {"max_picks": None},
    "σ 0.5 cm": {"position_noise": 0.005},
    "σ 2 cm": {"position_noise": 0.02},
    "σ 5 cm": {"position_noise": 0.05},
    "boxes × 0.8": {"stack": partial(stack_load, scale=0.8)},
    "boxes × 1.2": {"stack": partial(stack_load, scale=1.2)},
}
OPTIONS = {
    "--policies": {"dest": "names", "nargs": "+", "choices": COMPARED, "default": COMPARED},
    **JOBS,
}


def comparison_data(
    names: Sequence[str] = COMPARED,
    loads: int = COMPARISON_LOADS,
    folder: str | Path = files.DATA,
    n_jobs: int = -1,
) -> None:
    """Let policies unload the same containers under each condition: ``comparison.csv``.

    One row per policy, condition and container, with the columns of ``compare``. The learned
    policies are compared twice, with and without the mask.

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
    policies_by_name = {name: find_policy(name, folder) for name in names}
    jobs = [
        delayed(measured)(partial(compare, name, policies_by_name[name], mask, condition, loads))
        for condition in CONDITIONS
        for name in policies_by_name
        for mask in ((True, False) if name in LEARNED else (True,))
    ]
    results = Parallel(n_jobs)(jobs)
    weights = {name: policy_digest(name, folder) for name in names}
    publish(
        folder,
        "comparison",
        {"comparison": pd.concat([result.value for result in results])},
        f"{COMMAND} comparison --policies {' '.join(names)}",
        {"policies": weights, "loads": loads, "seed": SEED},
        loads < COMPARISON_LOADS or set(names) < set(COMPARED),
        [result.record for result in results],
        policies_fingerprint(names, folder),
    )


def compare(name: str, policy: Policy, mask: bool, condition: str, loads: int) -> pd.DataFrame:
    """The rows of ``evaluate`` for a policy under a condition.

    Returns:
        Its columns, and ``policy``, ``mask``, ``condition`` and ``load`` before them.
    """
    table = evaluate(policy, loads, SEED, mask=mask, **CONDITIONS[condition])
    for place, (column, value) in enumerate(
        {"policy": name, "mask": mask, "condition": condition, "load": range(loads)}.items()
    ):
        table.insert(place, column, value)
    return table


def find_policy(name: str, folder: str | Path = files.DATA) -> Policy:
    """One of ``COMPARED`` by its name.

    Raises:
        ValueError: another name.
        FileNotFoundError: see ``policy_file``.
    """
    checks.one_of("name", name, COMPARED)
    return SIMPLE[name] if name in SIMPLE else load_policy(policy_file(name, folder))


def policy_digest(name: str, folder: str | Path = files.DATA) -> str | None:
    """Digest of a learned policy's file; None for a simple policy.

    Raises:
        ValueError, FileNotFoundError: as ``find_policy`` does.
    """
    checks.one_of("name", name, COMPARED)
    if name in SIMPLE:
        return None
    return blake2b(policy_file(name, folder).read_bytes(), digest_size=16).hexdigest()


def policies_fingerprint(names: Sequence[str], folder: str | Path = files.DATA) -> str | None:
    """The fingerprint of the training that learned policies come from.

    Returns:
        None if no policy is learned, or if any training's fingerprint is absent or differs.
    """
    fingerprints = set()
    for name in LEARNED.keys() & set(names):
        try:
            provenance = read_provenance(folder, LEARNED[name])
        except FileNotFoundError:
            return None
        fingerprints.add(provenance.get("fingerprint"))
    return fingerprints.pop() if len(fingerprints) == 1 else None


def policy_file(name: str, folder: str | Path = files.DATA) -> Path:
    """Where a learned policy is kept: ``folder/policies/<name>.safetensors``.

    Raises:
        FileNotFoundError: it is absent; the message names it.
    """
    checks.one_of("name", name, LEARNED)
    path = Path(folder) / "policies" / f"{name}.safetensors"
    if not path.is_file():
        raise FileNotFoundError(f"{path} is absent; expected the policy {name!r} there")
    return path
