"""What noise does at the choice, what it does in the replay memory, and what the mask does.

    python -m studies choice

The published networks are evaluated with noise that is frozen for a load and with noise that is
drawn anew at each pick; nothing is trained. The laboratory parts the noise that a network chooses
by from the noise that it learns from, and takes the mask in training apart. The last section of
``data/ties/PLAN.md`` says what was expected.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
import pandas as pd

from studies.changes import repeated, without
from studies.falls import measures
from studies.falls.cells import B256, CONFIG
from studies.falls.laboratory import (
    SLOPES,
    TILTS,
    keep_cells,
    point,
    publish_cells,
    train_in_laboratory,
)
from studies.falls.long import LOADS, LONG, published_networks
from studies.grid import Cell, ask_policies, cell
from studies.paper.training import PAPER
from studies.results import COMMAND
from studies.statistics import end_msr
from studies.ties.noise import SPREAD, drifting
from studies.ties.training import TIES
from unload import task
from unload.agent.greedy import Greedy, greedy_actions
from unload.agent.policies import choosable
from unload.agent.training import Training
from unload.env.equalization import equalize
from unload.env.observation import POSITION_NOISE
from unload.env.vector import ContainerVectorEnv

NOISE = ("frozen", "anew")  # for a load, or at each pick
WAYS = list(product(NOISE, (False, True)))  # noise and mask
CHOICE_SEEDS, MASK_SEEDS = range(7000, 7020), range(8000, 8020)
COUNTS = ["msr", "failures", "deadlocked", "preference"]


def evaluate_choice(
    policy: Greedy,
    noise: str,
    mask: bool,
    place: bool = True,
    episodes: int = 100,
    seed: int = 0,
    see: Callable[[np.ndarray], np.ndarray] | None = None,
) -> dict[str, float]:
    """Let a network choose in fresh containers, 500 picks each, and sort its failures.

    Args:
        policy: of the network; says whether it sees ranks, and how ties are broken.
        noise: ``"frozen"``, drawn once for a load as the environments do, or ``"anew"``, drawn
            at each pick.
        mask: whether items that failed since the last success are excluded.
        place: whether the network sees x and y; they are 0 if not.
        episodes: number of containers.
        seed: of the loads, which are those of ``unload.evaluate``, and of the noise.
        see: what the network sees of positions, (batch, 128, 3); what ``policy`` says if None.

    Returns:
        ``msr``; the number of ``failures``; of them the ``deadlocked`` ones, whose item had failed
        since the last success, and of the others those by ``preference``: the network chooses an
        item that cannot be lifted also where ties share their mean rank.
    """
    seeds = np.random.SeedSequence(seed).generate_state(episodes).tolist()
    envs = ContainerVectorEnv(episodes, position_noise=POSITION_NOISE if noise == "frozen" else 0.0)
    rng, rows = np.random.default_rng(seed), np.arange(episodes)

    def choose(positions: np.ndarray, allowed: np.ndarray, ties: str) -> np.ndarray:
        if see is not None:
            seen = see(positions)
        else:
            seen = equalize(positions, ties) if policy.equalize else positions
        return greedy_actions(policy.network, seen if place else without(seen), allowed)

    counts = dict.fromkeys(COUNTS, 0)
    observations, infos = envs.reset(seed=seeds)
    for _ in range(task.MAX_PICKS):
        failed_before, present = infos["action_mask"] == 0, infos["item_mask"].astype(bool)
        allowed = choosable(~failed_before & present, present) if mask else present
        positions = observations
        if noise == "anew":
            positions = observations + SPREAD * rng.standard_normal(observations.shape)
        actions = choose(positions, allowed, policy.ties)

        # What a choice without noise could lift is asked before the pick changes the containers.
        deadlocked, shared = failed_before[rows, actions], actions.copy()
        sorted_out = (envs._lift(actions)[1] < task.LIFT_THRESHOLD) & ~deadlocked
        if sorted_out.any():
            shared[sorted_out] = choose(positions[sorted_out], allowed[sorted_out], "average")
        preference = sorted_out & (envs._lift(shared)[1] < task.LIFT_THRESHOLD)
        observations, rewards, _, _, infos = envs.step(actions)
        counts["msr"] += int((rewards > 0).sum())
        counts["failures"] += int((rewards <= 0).sum())
        counts["deadlocked"] += int(deadlocked.sum())
        counts["preference"] += int(preference.sum())
    envs.close()
    return counts | {"msr": counts["msr"] / (episodes * task.MAX_PICKS)}


def networks() -> dict[str, Greedy]:
    """All published networks that were trained without jams, and some that were not trained."""
    every = published_networks((PAPER, LONG, TIES))
    return {name: policy for name, policy in every.items() if "jams" not in name}


def ask(policy: Greedy, episodes: int, seed: int, places: Sequence[bool] = (True,)) -> list[dict]:
    """``noise``, ``mask``, ``place`` and what ``evaluate_choice`` says, in all ways to ask."""
    return [
        {"noise": noise, "mask": mask, "place": place}
        | evaluate_choice(policy, noise, mask, place, episodes, seed)
        for (noise, mask), place in product(WAYS, places)
    ]


def choice_change(choice: str, memory: str) -> Callable[[Training], None]:
    """The change of a laboratory run by its kinds of noise."""
    correlations = {"frozen": 1.0, "anew": 0.0}
    memory_too = None if choice == memory else (correlations[memory],) * 3
    return partial(drifting, correlation=(correlations[choice],) * 3, memory=memory_too)


def no_deadlocks_stored(run: Training) -> None:
    """Store no deadlocked pick; other picks of the same step are stored twice in their place.

    Where all of a step are deadlocked, what was stored last is stored again.
    """
    choose, add = run.agent.choose, run.replay.add
    deadlocked = np.zeros(run.config.num_envs, bool)

    def choose_and_note(*arguments) -> np.ndarray:
        nonlocal deadlocked
        actions = choose(*arguments)
        deadlocked = run.rollout.deadlocked(actions)
        return actions

    def add_others(**picks: np.ndarray) -> None:
        add(**repeated(run.replay, picks, np.flatnonzero(~deadlocked)))

    run.agent.choose, run.replay.add = choose_and_note, add_others


def filled_at_deadlocks(run: Training) -> None:
    """Fill a container anew as soon as a pick in it is deadlocked."""
    rollout, envs = run.rollout, run.rollout.envs.unwrapped
    pick = rollout.pick

    def pick_and_fill(actions: np.ndarray):
        deadlocked = rollout.deadlocked(actions)
        picked = pick(actions)
        if deadlocked.any():
            elapsed = envs._picks.copy()  # episodes go on together
            observations, _ = envs.reset(options={"reset_mask": deadlocked})
            envs._picks[:] = elapsed
            rollout._observe(observations, envs._infos())
        return picked

    rollout.pick = pick_and_fill


CHOICE_CELLS = {
    f"choice_{choice}_memory_{memory}{'' if mask else '_no_mask'}": cell(
        CONFIG, CHOICE_SEEDS, choice_change(choice, memory), position_noise=0.0, mask=mask
    )
    for choice, memory, mask in product(NOISE, NOISE, (False, True))
}
MASK_CELLS = {
    **{
        f"episodes_{picks}{'' if mask else '_no_mask'}": cell(
            B256, MASK_SEEDS, max_picks=picks, mask=mask
        )
        for picks, mask in product((25, 500), (False, True))
    },
    "no_deadlocks_stored_no_mask": cell(B256, MASK_SEEDS, no_deadlocks_stored, mask=False),
    "filled_at_deadlocks_no_mask": cell(B256, MASK_SEEDS, filled_at_deadlocks, mask=False),
}


def run_laboratory(name: str, planned: Cell, seed: int) -> dict:
    """Train a run of the laboratory, and evaluate its network in all ways."""
    trace: list[dict[str, float]] = []
    config = replace(planned.config, seed=seed)
    run = train_in_laboratory(config, planned.change, lambda run: trace.append(point(run)))
    points, policy = pd.DataFrame(trace), run.policy()
    row = {"cell": name, "seed": seed, "end": end_msr(run.curve.table())}
    for choices in ask(policy, **measures.LOADS):
        row[f"{choices['noise']}_{'mask' if choices['mask'] else 'no_mask'}"] = choices["msr"]
    row |= points[SLOPES].iloc[-1].to_dict() | points[TILTS].mean().to_dict()
    return row | {"tilt": float(points[TILTS].abs().mean().max())}


def choice_data(n_jobs: int = -1) -> None:
    """Write ``ties/choice.csv``: a row per network and way to ask it, see ``evaluate_choice``."""
    in_all_ways = partial(ask, places=(True, False))
    ask_policies(networks(), "ties/choice", in_all_ways, LOADS, f"{COMMAND} choice", n_jobs)


def choice_laboratory_data(n_jobs: int = -1) -> None:
    """Write ``ties/choice_laboratory.csv`` and ``ties/mask_laboratory.csv``, a row per run.

    ``cell`` and ``seed``; ``end``, the MSR while training over the last tenth; the MSR of its
    network in fresh containers by noise and mask; and its slopes at the end. The second has the
    tilt of the containers, too: ``tilt_x`` and ``tilt_y``, means over the training, and ``tilt``,
    the larger one of the mean sizes of both.
    """
    for name, cells in {"choice_laboratory": CHOICE_CELLS, "mask_laboratory": MASK_CELLS}.items():
        results = keep_cells(f"ties/{name}", cells, n_jobs, run_laboratory)
        rows = pd.DataFrame([result.value for result in results])
        if name == "choice_laboratory":  # its environments show ties in the items' order
            rows = rows.drop(columns=[*TILTS, "tilt"])
        config = next(iter(cells.values())).config
        place, part = f"ties/{name}", "choice_laboratory"
        publish_cells(place, part, rows, results, config, "%.5g", **measures.LOADS)
