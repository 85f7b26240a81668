"""Do the three physics agree? The same lifts, asked of ``table``, ``local`` and ``full``.

    python -m unload.reproduce agreement

Containers are unloaded by several policies, from seeds that nothing else uses. At several
stages some of the visible items are lifted, each from the same state; most of them are
hard cases, with one or two boxes on top. ``full`` is slow and asked about some lifts only:
those of a few states, drawn without looking at any answer, and all that are close, for
which ``local`` finds a distance near the threshold.
"""

from collections.abc import Callable, Iterator
from functools import partial
from hashlib import blake2b
from pathlib import Path
from typing import NamedTuple

import gymnasium
import numpy as np
import pandas as pd

from unload import task
from unload.agent import policies
from unload.load.boxes import Load
from unload.physics.bullet import SETTINGS
from unload.physics.full import FullPhysics
from unload.physics.local import LocalPhysics
from unload.physics.table import TablePhysics, shared_table
from unload.reproduce.results import COMMAND, JOBS, keep_all, measured, publish
from unload.support import checks, files

NAME = "lift_agreement"
LIFT_COUNT, FULL_COUNT = 5000, 300  # compared in table and local, and drawn for full
FRESH = 1_000_000  # seed of the first container; no other data uses it or the next ones
STAGES = (0, 100, 200, 300, 400, 500)  # picks after which items are lifted
WANTED = (2, 4, 4, 2)  # lifts per state with 0, 1, 2, and 3 or more boxes on top
CLOSE = (0.1, 0.3)  # m, distances in local that count as close to the threshold
DTYPES = {
    "policy": "str",
    "seed": "int64",
    "picks": "int64",
    "item": "int64",
    "on_top": "int64",
    "situation": "int64",
    "known": "bool",
    "asked_full": "str",
    "table": "float64",
    "local": "float64",
    "full": "float64",
}
OPTIONS = JOBS
UNLOADED_BY = {
    "random": policies.random,
    "nearest": policies.nearest,
    "highest": policies.highest,
    "mixed": policies.mixed(policies.highest, 0.3),
}


class State(NamedTuple):
    """A container on its way to be unloaded.

    Attributes:
        policy, seed, picks: how it got there, see ``container_states``.
        load: what it was filled with.
        present: (n,) bool, the items that are left.
        visible: (128,) int64, the items that can be picked.
    """

    policy: str
    seed: int
    picks: int
    load: Load
    present: np.ndarray
    visible: np.ndarray


def agreement_data(
    lifts: int = LIFT_COUNT,
    full: int = FULL_COUNT,
    seed: int = FRESH,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = 1,
    progress: bool = True,
) -> pd.DataFrame:
    """Compare lifts; write ``folder/lift_agreement.csv`` and its provenance.

    A run that was stopped goes on with the answers of ``full`` that it has.

    Args:
        lifts: how many at least, in ``table`` and ``local``.
        full: how many of these at least are drawn for ``full``; the close ones come on top.
        seed: of the first container.
        folder: of the data.
        runs_dir: where the answers of ``full`` are kept.
        n_jobs: processes for ``full``, as in joblib.
        progress: show a progress bar.

    Returns:
        See ``read_agreement``.

    Raises:
        TypeError, ValueError: a number is not as described.
    """
    checks.integer("full", full, 0, checks.integer("lifts", lifts, 1))
    (states, frame), record = measured(partial(collect_lifts, lifts, seed))
    frame["asked_full"] = choose_for_full(frame, full, np.random.default_rng(seed))
    asked = frame[frame["asked_full"] != ""]
    jobs = [full_job(states[number], item) for number, item in zip(asked["state"], asked["item"])]
    answers = keep_all(Path(runs_dir) / "agreement", jobs, n_jobs, progress)
    frame["full"] = pd.Series([answer.value for answer in answers], asked.index, "float64")
    settings = {
        "lifts": len(frame),
        "situations": int(frame["situation"].nunique()),
        "in full, drawn": int((frame["asked_full"] == "drawn").sum()),
        "in full, close": int((frame["asked_full"] == "close").sum()),
        "first seed": seed,
        "policies": list(UNLOADED_BY),
        "stages (picks)": STAGES,
    }
    publish(
        folder,
        NAME,
        {NAME: frame[list(DTYPES)]},
        f"{COMMAND} agreement",
        settings,
        lifts < LIFT_COUNT or full < FULL_COUNT,
        [record, *(answer.record for answer in answers)],
        float_format="%.6f",
    )
    return read_agreement(folder)


def read_agreement(folder: str | Path = files.DATA) -> pd.DataFrame:
    """The table that ``agreement_data`` wrote, one row per lift.

    Returns:
        ``policy``, ``seed`` and ``picks`` name the state of the container; ``item`` is the
        box lifted, ``on_top`` the number of boxes on it; lifts with equal ``situation``
        are the same to ``local``; ``known`` says whether ``table`` had its answer before;
        ``asked_full`` is ``"drawn"``, ``"close"`` or empty; ``table``, ``local`` and
        ``full`` are how far the box moved in m, NaN where ``full`` was not asked.

    Raises:
        FileNotFoundError: there is no such file.
    """
    path = Path(folder) / f"{NAME}.csv"
    return pd.read_csv(path, dtype=DTYPES).fillna({"asked_full": ""})


def disagreements(frame: pd.DataFrame, one: str, other: str) -> pd.DataFrame:
    """The lifts that succeed in one physics and not in the other; both must be known."""
    checks.one_of("one", one, ("table", "local", "full"))
    checks.one_of("other", other, ("table", "local", "full"))
    known = frame[frame[one].notna() & frame[other].notna()]
    lifted = known[[one, other]] >= task.LIFT_THRESHOLD
    return known[lifted[one] != lifted[other]]


def container_states(policy: str, seed: int) -> Iterator[State]:
    """The states of one container at each of ``STAGES``, unloaded with ``table``."""
    checks.one_of("policy", policy, UNLOADED_BY)
    env = gymnasium.make("unload/Container-v0", physics="table").unwrapped
    rng = np.random.default_rng([seed, 1])  # not what draws the load
    observation, info = env.reset(seed=seed)
    for picks in range(max(STAGES) + 1):
        if picks in STAGES:
            present, visible = env.physics.present.copy(), env.visible.copy()
            yield State(policy, seed, picks, env.physics.load, present, visible)
        if picks < max(STAGES):
            chosen = UNLOADED_BY[policy](observation[None], info["action_mask"][None], rng)
            observation, _, _, _, info = env.step(chosen[0])
    env.close()


def collect_lifts(lifts: int, seed: int) -> tuple[list[State], pd.DataFrame]:
    """At least so many lifts, asked of ``table`` and ``local``.

    Containers take turns in ``UNLOADED_BY``, with the seeds ``seed``, ``seed + 1``, …

    Returns:
        The states, and the columns of ``read_agreement`` without those of ``full`` but
        with ``state``, an index into the states.
    """
    states, rows, numbers = [], [], {}
    table, local = TablePhysics(shared_table()), LocalPhysics()
    rng = np.random.default_rng([seed, 2])
    names = list(UNLOADED_BY)
    while len(rows) < lifts:
        container = len(states) // len(STAGES)
        for state in container_states(names[container % len(names)], seed + container):
            for physics in (table, local):
                physics.reset(state.load)
                for item in np.flatnonzero(~state.present):
                    physics.remove(item)
            for item in choose_items(state, local, rng):
                known = len(table.table)
                distances = {"table": table.lift(item), "local": local.lift(item)}
                situation = local.surroundings.situation(item)
                row = {"state": len(states), **state._asdict(), "item": item}
                row |= {"on_top": situation.on_top, "known": len(table.table) == known}
                row |= {"situation": numbers.setdefault(situation.key, len(numbers))}
                rows.append(row | distances)
            states.append(state)
    local.close()
    return states, pd.DataFrame(rows).drop(columns=["load", "present", "visible"])


def choose_items(state: State, local: LocalPhysics, rng: np.random.Generator) -> list[int]:
    """Some visible items, as many of each kind as ``WANTED`` says or as there are."""
    on_top = np.array([len(local.surroundings.on_top(item)) for item in state.visible])
    kinds = np.minimum(on_top, len(WANTED) - 1)
    chosen = []
    for kind, wanted in enumerate(WANTED):
        items = state.visible[kinds == kind]
        chosen += rng.choice(items, min(wanted, len(items)), replace=False).tolist()
    return chosen


def choose_for_full(frame: pd.DataFrame, count: int, rng: np.random.Generator) -> np.ndarray:
    """Label of each lift: ``"drawn"``, ``"close"`` or empty.

    All lifts of a state are drawn together, until at least ``count`` lifts are.
    """
    close = frame["local"].between(*CLOSE) & (count > 0)
    chosen = np.where(close, "close", "").astype(object)
    for state in rng.permutation(frame["state"].max() + 1):
        if (chosen == "drawn").sum() >= count:
            break
        chosen[frame["state"] == state] = "drawn"
    return chosen


def full_job(state: State, item: int) -> tuple[dict, Callable[[], float]]:
    """Question and computation of one lift in ``full``, for ``keep_all``.

    The item is lifted in a world of its own, in which all boxes left in the container are
    simulated. In a world that has seen other lifts, the answer depends on them (by a
    millimetre or so), and so on the order in which the items are lifted.
    """
    load, present = state.load, np.flatnonzero(state.present)
    left = Load(
        load.positions[present], load.sizes[present], load.packages[present], load.walls[present]
    )
    boxes = blake2b(left.positions.tobytes() + left.sizes.tobytes(), digest_size=16).hexdigest()
    box = int(np.searchsorted(present, item))
    return {"settings": SETTINGS, "boxes": boxes, "item": box}, partial(full_distance, left, box)


def full_distance(load: Load, item: int) -> float:
    """How far ``full`` moves an item of a load that has seen no other lift, in m."""
    physics = FullPhysics()
    physics.reset(load)
    distance = physics.lift(item)
    physics.close()
    return distance
