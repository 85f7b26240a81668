"""Runs of the paper's length: trained with what the laboratory says changed, traced, and judged.

    python -m studies falls

Judged are all published policies, with a part of what they see blanked, and networks without
training.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial

import pandas as pd
import torch

from studies import changes
from studies.falls import measures
from studies.falls.laboratory import POINT, point, train_in_laboratory
from studies.fingerprint import training_fingerprint
from studies.grid import Grid, ask_policies, cell, policies_of, train_grid
from studies.paper.training import PAPER
from studies.results import COMMAND, keep_all, publish
from unload.agent.config import TrainConfig
from unload.agent.greedy import Greedy
from unload.network.peq import PEQNetwork

CONFIG = TrainConfig(batch_size=256, mask=True)
B2048 = TrainConfig(mask=True)
SEEDS, FEW_SEEDS = range(20, 25), range(20, 23)
EXPLORED = 10_000_000  # picks after which the agent no longer explores
TRACED_SEEDS = (20, 21)
TRACE_EVERY = 32_000  # picks: an episode of all containers
LONG = Grid(
    "falls/long",
    f"{COMMAND} falls",
    {
        "shuffled": cell(CONFIG, SEEDS, changes.shuffled),
        "ranks": cell(CONFIG, SEEDS),
        "shuffled_no_mask": cell(CONFIG, SEEDS, changes.shuffled, mask=False),
        "successes": cell(CONFIG, SEEDS, partial(changes.successes_only, start=EXPLORED)),
        "ranks_no_mask": cell(CONFIG, SEEDS, mask=False),
        "episodes_25": cell(CONFIG, FEW_SEEDS, max_picks=25),
        "mirrored": cell(CONFIG, SEEDS, changes.mirrored),
        "shuffled_b2048": cell(B2048, FEW_SEEDS, changes.shuffled),
        "shuffled_b2048_no_mask": cell(B2048, FEW_SEEDS, changes.shuffled, mask=False),
    },
)
LOADS = {"episodes": 100, "seed": 1000}  # that policies are judged in, 500 picks each
UNTRAINED = 36  # networks, as many as there are runs in the paper's four cells


def falls_data(cells: Sequence[str] | None = None, n_jobs: int = -1) -> None:
    """Train the long runs, see ``train_grid``; then trace two, and judge all published policies.

    Of some cells alone, nothing is traced or judged.
    """
    train_grid(LONG, cells, n_jobs=n_jobs)
    if cells is None:
        trace_data(n_jobs=n_jobs)
        published_data(n_jobs=n_jobs)


def trace_data(n_jobs: int = -1) -> None:
    """Trace runs with the mask, every 32,000 picks: ``falls/long_trace.csv``."""
    fingerprint = training_fingerprint()
    question = {"every": TRACE_EVERY}
    configs = [replace(CONFIG, seed=seed) for seed in TRACED_SEEDS]
    asked = [(question | config.plain(), (config,)) for config in configs]
    results = keep_all("falls/trace", _trace, asked, n_jobs)
    traces = [
        pd.DataFrame(result.value).assign(seed=seed) for seed, result in zip(TRACED_SEEDS, results)
    ]
    tables = {"long_trace": pd.concat(traces)[["seed", *POINT]].astype({"picks": int})}
    settings = {"seeds": list(TRACED_SEEDS), "picks": CONFIG.picks}
    name, command = "falls/long_trace", f"{COMMAND} falls"
    publish(name, tables, command, settings, results, fingerprint, "%.4g")


def _trace(config: TrainConfig) -> list[dict[str, float]]:
    """The points of a run's trace, see ``laboratory.point``."""
    points: list[dict[str, float]] = []
    train_in_laboratory(config, watch=lambda run: points.append(point(run)), every=TRACE_EVERY)
    return points


def published_data(n_jobs: int = -1) -> None:
    """Judge each published policy in fresh containers: ``falls/published.csv``.

    A row per policy: its cell and seed; its MSR as it is and with x, y or both set to 0, with the
    mask on. The cell ``untrained`` holds networks as they are drawn.
    """
    policies = published_networks((PAPER, LONG))
    ask_policies(policies, "falls/published", judge, LOADS, LONG.command, n_jobs)


def published_networks(grids: Iterable[Grid]) -> dict[str, Greedy]:
    """The published policies of grids, and ``UNTRAINED`` networks as they are drawn.

    These say what those of the trained ones owe to their training.
    """
    policies: dict[str, Greedy] = {}
    for grid in grids:
        policies |= policies_of(grid)
    for seed in range(UNTRAINED):
        network = PEQNetwork(generator=torch.Generator().manual_seed(seed))
        policies[f"untrained/seed_{seed}"] = Greedy(network, equalize=True)
    return policies


def judge(policy: Greedy, **loads: int) -> list[dict]:
    """One row of what ``measures.judged`` says of a policy as it is, and of it without place."""
    config = TrainConfig(equalize=policy.equalize, ties=policy.ties, mask=True)
    return [
        {
            f"judged_{name}": measures.judged(policy.network, config, blank, loads=loads)
            for name, blank in measures.BLANKED.items()
        }
    ]
