"""The laboratory's answer to why the mask does harm in training.

    python -m studies mask_laboratory

``data/mask/PLAN.md`` says what was expected of its cells.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import gymnasium
import numpy as np
import pandas as pd
from torch import nn

from studies import changes
from studies.falls import measures
from studies.falls.cells import B256, SHORT, Change
from studies.falls.laboratory import SLOPES, keep_cells, train_in_laboratory
from studies.fingerprint import training_fingerprint
from studies.grid import Cell, cell
from studies.mask.cells import EARLY, LATE, learn_from, out_of_step
from studies.results import COMMAND, publish
from studies.statistics import end_msr
from unload import task
from unload.agent.greedy import greedy_actions
from unload.agent.training import Training

SEEDS = range(9500, 9520)
MASKS = {"": True, "_no_mask": False}  # how a cell's name ends
STAGES = {"msr_25": (0, 25), "msr_100": (25, 100), "msr_500": (100, 500)}  # picks of an episode
FEW_LOADS = {"episodes": 16, "seed": 1000}  # fresh containers
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
        for ending, mask in MASKS.items()
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
    row |= by_stage(run.agent.network, **FEW_LOADS)
    return row | dict(zip(SLOPES, map(float, slopes[-1])))


def laboratory_data(n_jobs: int = -1) -> None:
    """Write ``mask/laboratory.csv``, a row per run.

    ``cell`` and ``seed``; ``end``, the MSR while training over the last tenth; ``msr`` and that of
    each stage in 16 fresh containers, see ``by_stage``; and the score's slopes at the end.
    """
    results = keep_cells("mask/laboratory", CELLS, n_jobs, run_cell)
    rows = pd.DataFrame([result.value for result in results])
    settings = {"config": B256.plain(), "runs": len(rows)} | FEW_LOADS
    fingerprint, command = training_fingerprint(), f"{COMMAND} mask_laboratory"
    tables = {"laboratory": rows}
    publish("mask/laboratory", tables, command, settings, results, fingerprint, "%.5g")
