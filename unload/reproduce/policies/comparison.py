"""Picking policies compared where the lift table reaches.

    python -m unload.reproduce policies

Rules and learned policies unload the same containers: in the conditions of the training, with
blurred positions, and with boxes of other sizes.
"""

from functools import partial
from hashlib import blake2b
from pathlib import Path

import pandas as pd
from joblib import Parallel, delayed

from unload.agent import policies
from unload.agent.evaluation import Policy, evaluate
from unload.agent.greedy import content_of, load_policy
from unload.load.substacks import stack_load
from unload.reproduce.results import COMMAND, measured, publish
from unload.support import checks, files

SIMPLE = {"random": policies.random, "nearest": policies.nearest, "highest": policies.highest}
# Trainings of the paper's configuration end in two ways: one of each is compared.
LEARNED = ("paper", "paper_seed_2", "recommended")
# Who plays, by policy and mask: the rules with the mask only.
PLAYERS = (
    *((name, True) for name in SIMPLE),
    *((name, mask) for name in LEARNED for mask in (True, False)),
)
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


def comparison_data(
    loads: int = COMPARISON_LOADS, folder: str | Path = files.DATA, n_jobs: int = -1
) -> None:
    """Let policies unload the same containers under each condition: ``policies/comparison.csv``.

    One row per policy, condition and container, with the columns of ``compare``. The learned
    policies are compared twice, with and without the mask.

    Args:
        loads: containers each.
        folder: of the data.
        n_jobs: processes, as in joblib.
    """
    checks.integer("loads", loads, 1)
    found = {name: find_policy(name) for name in (*SIMPLE, *LEARNED)}
    results = Parallel(n_jobs)(
        delayed(measured)(partial(compare, name, found[name], mask, condition, loads))
        for condition in CONDITIONS
        for name, mask in PLAYERS
    )
    publish(
        Path(folder) / "policies",
        "comparison",
        {"comparison": pd.concat([result.value for result in results])},
        f"{COMMAND} policies",
        {"policies": digests(), "loads": loads, "seed": SEED},
        loads < COMPARISON_LOADS,
        [result.record for result in results],
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


def find_policy(name: str) -> Policy:
    """A rule, or a policy that ships, by its name.

    Raises:
        ValueError: an unknown name.
    """
    checks.one_of("name", name, (*SIMPLE, *LEARNED))
    return SIMPLE[name] if name in SIMPLE else load_policy(name)


def digests() -> dict[str, str]:
    """A digest of each learned policy, of its file without the card."""
    return {
        name: blake2b(content_of(load_policy(name), card=False), digest_size=16).hexdigest()
        for name in LEARNED
    }
