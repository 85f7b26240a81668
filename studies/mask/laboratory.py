"""Why the mask does harm in training: the laboratory, and runs of the paper's length.

    python -m studies mask
    python -m studies mask_laboratory

``data/mask/PLAN.md`` says what was expected of their cells.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import gymnasium
import numpy as np
import pandas as pd
from torch import nn

from studies import changes
from studies.falls import measures
from studies.falls.cells import B256, ENDINGS, SHORT, Change
from studies.falls.laboratory import SLOPES, keep_cells, publish_cells, train_in_laboratory
from studies.falls.long import LOADS
from studies.grid import Cell, ask_policies, cell, policies_of, train_grid
from studies.mask.cells import EARLY, LATE, MASK, learn_from, out_of_step
from studies.statistics import end_msr
from unload import task
from unload.agent.greedy import Greedy, greedy_actions
from unload.agent.training import Training

SEEDS = range(9500, 9520)
STAGES = {"msr_25": (0, 25), "msr_100": (25, 100), "msr_500": (100, 500)}  # picks of an episode
LEARNED: dict[str, tuple[Change, Mapping[str, int]]] = {
    "all": (None, {}),
    "early": (EARLY, {}),
    "fewer_than_100": (partial(learn_from, fewer_than=100), {}),
    "late": (LATE, {}),
    **{f"episodes_{picks}": (None, {"max_picks": picks}) for picks in (25, 50, 100, 250)},
    "out_of_step": (out_of_step, {}),
}
DUG = partial(changes.dug, preference=0.0)
CELLS: dict[str, Cell] = {
    **{
        f"{name}{ending}": cell(B256, SEEDS, change, mask=mask, **fields)
        for ending, mask in ENDINGS.items()
        for name, (change, fields) in LEARNED.items()
    },
    # Early picks are few, so that the memory drops none of them, not even the first random ones.
    "all_long_memory": cell(B256, SEEDS[:10], mask=True, replay_size=B256.picks),
    "early_short_memory": cell(B256, SEEDS[:10], EARLY, mask=True, replay_size=3000),
    "dug_25": cell(B256, SEEDS, DUG, **SHORT),
    "dug_500_no_mask": cell(B256, SEEDS, DUG, mask=False),
}


def by_stage(network: nn.Module, episodes: int, seed: int) -> dict[str, float]:
    """MSR of a network that sees ranks, with the mask, by how far an episode has come.

    Args:
        network: (batch, items, 3) → (batch, items) action values.
        episodes: number of fresh containers.
        seed: of their loads, which are those of ``unload.evaluate``.

    Returns:
        ``msr``, of all 500 picks, and that of each of ``STAGES``.
    """
    seeds = np.random.SeedSequence(seed).generate_state(episodes).tolist()
    envs = gymnasium.make_vec("unload/Container-v0", episodes, equalize=True)
    observations, infos = envs.reset(seed=seeds)
    succeeded = np.zeros((task.MAX_PICKS, episodes))
    for pick in range(task.MAX_PICKS):
        allowed = infos["action_mask"].astype(bool)
        actions = greedy_actions(network, observations, allowed)
        observations, rewards, _, _, infos = envs.step(actions)
        succeeded[pick] = rewards > 0
    envs.close()
    stages = {name: succeeded[first:stop].mean() for name, (first, stop) in STAGES.items()}
    return {"msr": succeeded.mean()} | stages


def run_cell(name: str, planned: Cell, seed: int) -> dict:
    """Train a run of the laboratory, and judge its network."""
    slopes: list[np.ndarray] = []

    def note(run: Training) -> None:
        slopes.append(measures.slopes(run.agent.network, run.rollout.observations))

    run = train_in_laboratory(replace(planned.config, seed=seed), planned.change, note)
    row = {"cell": name, "seed": seed, "end": end_msr(run.curve.table())}
    row |= by_stage(run.agent.network, **measures.LOADS)
    return row | dict(zip(SLOPES, map(float, slopes[-1])))


def laboratory_data(n_jobs: int = -1) -> None:
    """Write ``mask/laboratory.csv``, a row per run.

    ``cell`` and ``seed``; ``end``, the MSR while training over the last tenth; ``msr`` and that of
    each stage in 16 fresh containers, see ``by_stage``; and the score's slopes at the end.
    """
    results = keep_cells("mask/laboratory", CELLS, n_jobs, run_cell)
    rows = pd.DataFrame([result.value for result in results])
    place, part = "mask/laboratory", "mask_laboratory"
    publish_cells(place, part, rows, results, B256, "%.5g", **measures.LOADS)


def mask_data(cells: Sequence[str] | None = None, n_jobs: int = -1) -> None:
    """Train the grid, see ``train_grid``, and judge all published networks.

    ``mask/judged.csv`` has a row per network, see ``by_stage``.
    """
    train_grid(MASK, cells, n_jobs)
    ask_policies(policies_of(MASK), "mask/judged", ask_by_stage, LOADS, MASK.command, n_jobs)


def ask_by_stage(policy: Greedy, episodes: int, seed: int) -> list[dict]:
    """One row of what ``by_stage`` says of a policy's network."""
    return [by_stage(policy.network, episodes, seed)]
