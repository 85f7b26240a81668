"""The laboratory's answers about the index: other rows, other weights of z, and what is possible.

    python -m studies order_laboratory

``data/order/PLAN.md`` says what was expected of its cells.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
import pandas as pd

from studies import changes
from studies.falls import measures
from studies.falls.cells import B256, CONFIG, ENDINGS, SHORT, Change, changed
from studies.falls.laboratory import keep_cells, publish_cells, train_in_laboratory
from studies.fingerprint import training_fingerprint
from studies.grid import Cell, cell
from studies.order.index import BY_ROWS, see_index, sorted_index
from studies.paper import tuning
from studies.paper.visible_items import BINS
from studies.results import COMMAND, keep_all, publish
from studies.seamless.jamming import weigh
from studies.statistics import end_msr
from unload import task
from unload.agent.training import Training
from unload.load.boxes import ABOVE, BELOW, BESIDE

SEEDS, FEW_SEEDS = range(9600, 9610), range(9600, 9603)
SEEN: dict[str, Change] = {"rank": None, "index": see_index}
WEIGHTS = (4.0, 1.0, 0.5, 0.25)  # of z in W; the paper's is 4
RANDOM = {"epsilon_init": 1.0, "epsilon_final": 1.0}
EPISODE = task.NUM_ENVS * task.MAX_PICKS  # picks, of all containers
DISPLACED = 0.02  # m, a displacement along x and y that lasts


def weighted(weight: float) -> Change:
    """The change of W's weight of z; None for the paper's."""
    return None if weight == WEIGHTS[0] else partial(weigh, z=weight)


def one_in_four(run: Training) -> None:
    """Update once in four steps of the environments, as Stable-Baselines3 does by default."""
    step, configs = run.step, (replace(run.config, gradient_steps=0), run.config)

    def step_sometimes_updating() -> None:
        run.config = configs[run.rollout.steps % 4 == 0]
        step()

    run.step = step_sometimes_updating


def displacing(run: Training, see: Callable[[np.ndarray], np.ndarray] | None = None) -> None:
    """Let each attempt displace what touches the picked box, as it is seen, for good.

    The containers stay as they are; where boxes are seen changes.

    Args:
        run: with ``equalize``, in full containers.
        see: what is seen of the positions, (num_envs, 128, 3); their ranks if None.
    """
    envs, config = run.rollout.envs.unwrapped, run.config
    choose, add, pick = run.agent.choose, run.replay.add, run.rollout.pick
    offsets: np.ndarray = np.zeros(0)
    spread = 2 * DISPLACED / task.CONTAINER * [1, 1, 0]
    seen = np.empty(0)

    def choose_displaced(observations: np.ndarray, *rest) -> np.ndarray:
        nonlocal offsets, seen
        state = envs._containers
        if run.rollout.steps % config.max_picks == 0:  # all containers have just been filled
            offsets = np.zeros((*state.present.shape, 3), np.float32)
        rows = np.arange(config.num_envs)[:, None]
        positions = state.values.transpose(0, 2, 1) + offsets[rows, state.visible]
        order = sorted_index(positions)
        seen = sorted_index(order) if see is None else order  # sorting twice gives the rank
        return choose(seen, *rest)

    def pick_and_displace(actions: np.ndarray):
        state = envs._containers
        rng = np.random.default_rng((config.seed, run.rollout.steps))
        for env, item in enumerate(state.visible[np.arange(config.num_envs), actions]):
            for kind in (ABOVE, BELOW, BESIDE):
                first, stop = state.starts[env, kind, item], state.starts[env, kind, item + 1]
                touched = state.links[env, first:stop]
                offsets[env, touched] += spread * rng.standard_normal((len(touched), 3))
        return pick(actions)

    run.agent.choose, run.rollout.pick = choose_displaced, pick_and_displace
    run.replay.add = lambda observations, **rest: add(observations=seen, **rest)


CELLS: dict[str, Cell] = {
    **{
        f"{seen}_weight_{weight:g}{ending}": cell(
            B256,
            SEEDS if weight == WEIGHTS[0] else FEW_SEEDS,
            changed(weighted(weight), SEEN[seen]),
            mask=mask,
        )
        for weight, seen, (ending, mask) in product(WEIGHTS, SEEN, ENDINGS.items())
    },
    **{
        f"index_by_{rows}_weight_{weight:g}{ending}": cell(
            B256,
            SEEDS if mask and weight == WEIGHTS[0] else FEW_SEEDS,
            changed(weighted(weight), BY_ROWS[rows]),
            mask=mask,
        )
        for rows, weight, (ending, mask) in product(
            ("height", "wall", "random"), WEIGHTS, ENDINGS.items()
        )
    },
    # The ceiling: what random picks teach, in which no choice acts on what is learned from.
    **{f"random_{seen}": cell(B256, SEEDS, change, **RANDOM) for seen, change in SEEN.items()},
    **{
        f"random_{seen}_dug": cell(
            B256, SEEDS, changed(partial(changes.dug, preference=0.0), change), **RANDOM, **SHORT
        )
        for seen, change in SEEN.items()
    },
    # Readings that nobody has tried.
    **{
        f"{seen}_one_in_four": cell(B256, FEW_SEEDS, changed(change, one_in_four))
        for seen, change in SEEN.items()
    },
    **{
        f"{seen}_displacing": cell(
            B256, FEW_SEEDS, partial(displacing, see=None if seen == "rank" else sorted_index)
        )
        for seen in SEEN
    },
    **{
        f"{seen}_in_steps": cell(B256, range(9600, 9601), change, picks=64 * CONFIG.picks)
        for seen, change in SEEN.items()
    },
}
# Of what is seen as the environments show it, networks are judged in fresh containers.
JUDGED = ("rank_weight_4", "index_weight_4", "random_")
# The tuning of Figs. 8 and 9, with the index.
TUNED = {
    f"b{batch_size}/lr_{rate:g}": Cell(
        replace(tuning.CONFIG, batch_size=batch_size, learning_rate=rate), FEW_SEEDS, see_index
    )
    for batch_size, rate in product(tuning.BATCH_SIZES, tuning.LEARNING_RATES)
}


def run_cell(name: str, planned: Cell, seed: int) -> dict:
    """Train a run of the laboratory, and say how it started and ended."""
    config = replace(planned.config, seed=seed)
    run = train_in_laboratory(config, planned.change)
    curve = run.curve.table()
    episodes = curve.groupby((curve["picks"] - 1) // EPISODE)["success_rate"].mean()
    row = {"cell": name, "seed": seed, "start": episodes.iloc[0], "end": end_msr(curve)}
    row |= {"best": episodes.max(), "judged": np.nan}
    if name.startswith(JUDGED):
        seen = None if "rank" in name else sorted_index
        row["judged"] = measures.judged(run.agent.network, replace(config, mask=True), seen=seen)
    return row


def tune(name: str, planned: Cell, seed: int) -> dict:
    """Train a run of the tuning with the index, and say how it ended."""
    run = train_in_laboratory(replace(planned.config, seed=seed), planned.change)
    curve = run.curve.table()
    summary = tuning.run_summary(curve["success_rate"].to_numpy(), curve["loss"].to_numpy())
    return {"cell": name, "seed": seed, **summary}


def what_index_says(weight: float, seed: int) -> dict[str, float]:
    """What the index tells of boxes that random picks leave, by W's weight of z.

    Args:
        weight: of z.
        seed: of 64 loads and of the picks.

    Returns:
        ``start`` and ``random``, MSR of the first 25 picks of each container and of all 500;
        ``free``, the share of visible boxes that a lift would unload; ``free_rank``,
        ``free_index``, how often the box with the highest rank or index along z is such a box;
        ``corr_x``, ``corr_y``, ``corr_z``, correlations of index and rank; means over 20 moments.
        ``bar``, the tallest bar of Fig. 5 at first, a mean over loads.
    """
    config = replace(B256, seed=seed, picks=EPISODE, log_interval=25, gradient_steps=0, **RANDOM)
    moments: list[dict[str, float]] = []

    def look(run: Training) -> None:
        ranks, free = run.rollout.observations, run.rollout.envs.unwrapped.liftable()
        index, rows = sorted_index(ranks), np.arange(len(ranks))
        moment = {"free": free.mean()}
        for name, values in {"rank": ranks, "index": index}.items():
            moment[f"free_{name}"] = free[rows, values[..., 2].argmax(axis=1)].mean()
        # Both hold the same numbers, evenly spread around 0.
        alike = (ranks * index).mean(axis=(0, 1)) / (ranks**2).mean(axis=(0, 1))
        moments.append(moment | dict(zip(("corr_x", "corr_y", "corr_z"), map(float, alike))))

    run = train_in_laboratory(config, weighted(weight), look, every=25 * task.NUM_ENVS)
    rates = run.curve.table()["success_rate"]
    full = Training(replace(config, equalize=False), change=weighted(weight))
    full.rollout.close()
    bars = [np.histogram(each[:, 0], BINS)[0].max() for each in full.rollout.observations]
    means = pd.DataFrame(moments).mean().to_dict()
    named = {"weight": weight, "seed": seed, "start": rates.iloc[0], "random": rates.mean()}
    return named | {"bar": float(np.mean(bars))} | means


def laboratory_data(n_jobs: int = -1) -> None:
    """Write ``order/laboratory.csv``, ``order/tuning.csv`` and ``order/rows.csv``.

    The first has a row per run: ``start``, ``end`` and ``best``, the MSR while training over the
    first episode of all containers, the last tenth and the best episode; and for some cells
    ``judged``, in 16 fresh containers with the mask. The second has ``run_summary`` of each run of
    the tuning, the third what ``what_index_says``.
    """
    part = "order_laboratory"
    for name, cells, compute, config in (
        ("laboratory", CELLS, run_cell, B256),
        ("tuning", TUNED, tune, tuning.CONFIG),
    ):
        results = keep_cells(f"order/{name}", cells, n_jobs, compute)
        rows = pd.DataFrame([result.value for result in results])
        publish_cells(f"order/{name}", part, rows, results, config, "%.5g")
    asked = [
        ({"weight": each, "seed": seed}, (each, seed)) for each, seed in product(WEIGHTS, (0, 1))
    ]
    results = keep_all("order/rows", what_index_says, asked, n_jobs)
    rows = pd.DataFrame([result.value for result in results])
    settings = {"weights": WEIGHTS, "seeds": [0, 1]}
    tables, command, fingerprint = {"rows": rows}, f"{COMMAND} {part}", training_fingerprint()
    publish("order/rows", tables, command, settings, results, fingerprint, "%.5g")
