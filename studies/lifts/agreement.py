"""Do the three physics agree? The same lifts, asked of ``table``, ``local`` and ``full``.

    python -m studies lifts

Containers are unloaded by several policies, from seeds that nothing else uses. At several
stages some of the visible items are lifted, each from the same state; most of them are
hard cases, with one or two boxes on top. ``full`` is slow and asked about some lifts only:
a few of each of many states, drawn without looking at any answer; as many with three or more
boxes on top, which ``table`` answers without a simulation; and all that are close, for which
``local`` finds a distance near the threshold. These worlds are fresh; what drift does to the picks
of a policy, ``studies.policies.comparison`` tells.
"""

from functools import partial

import numpy as np
import pandas as pd

from studies.lifts.lift_table import mixed
from studies.policies.comparison import SIMPLE
from studies.policies.margin import containers
from studies.results import COMMAND, code_of, keep_all, measured, publish
from studies.statistics import share_interval
from unload import task
from unload.load.boxes import Load
from unload.load.substacks import WALLS
from unload.physics.bullet import ENGINES, SETTINGS
from unload.physics.full import FullPhysics
from unload.physics.local import LocalPhysics
from unload.physics.situation import Surroundings
from unload.physics.table import HELD_DOWN, LIFTS_FILE, LiftTable, TablePhysics
from unload.support import files

NAME = "lift_agreement"
NEAR_WALLS = 5  # the item's own wall and two on each side
LIFT_COUNT = 5000  # at least, compared in table and local
FULL_COUNT = 300  # of these, drawn for full at least, and as many with three or more boxes on top
FIRST_SEED = 1_000_000  # of the containers; no other data uses it or the next ones
STAGES = (0, 100, 200, 300, 400, 500)  # picks after which items are lifted
WANTED = (2, 4, 4, 2)  # lifts per state with 0, 1, 2, and 3 or more boxes on top
PER_STATE = 3  # lifts of a state that are drawn for full
WHOLE = 5  # of every so many states drawn, one is asked about in the whole container
CLOSE = (0.1, 0.3)  # m, distances in local that count as close to the threshold
ASKED_FULL = ("drawn", "buried", "close")
COLUMNS = [
    "policy", "seed", "picks", "item", "on_top", "situation",
    "asked_full", "walls", "table", "local", "full",
]  # fmt: skip
UNLOADED_BY = SIMPLE | {"mixed": mixed(SIMPLE["highest"], 0.3)}


def agreement_data(n_jobs: int = 1) -> None:
    """Compare lifts; write ``lift_agreement.csv``, one row per lift, and its provenance.

    ``policy``, ``seed`` and ``picks`` name the state of the container; ``item`` is the box lifted,
    ``on_top`` the number of boxes on it; lifts with equal ``situation`` are the same to ``local``;
    ``table``, ``local`` and ``full`` are how far the box moved in m, NaN where ``full`` was not
    asked. ``asked_full`` says why it was, "drawn", "buried" or "close", and is empty where it was
    not; ``walls`` is how many item walls it simulated: 5 for the item's own and two on each side,
    12 for the whole container.

    A run that was stopped goes on with the answers of ``full`` that it has.
    """
    collected = measured(partial(collect_lifts, LIFT_COUNT, FIRST_SEED))
    states, frame = collected.value
    rng = np.random.default_rng(FIRST_SEED)
    frame["asked_full"], frame["walls"] = choose_for_full(frame, FULL_COUNT, rng)

    # Full takes seconds for each lift, so that answers are kept one by one.
    asked = frame.index[frame["asked_full"] != ""]
    columns = (frame.loc[asked, name] for name in ("state", "item", "walls"))
    lifts = [fresh_lift(*states[state], item, walls) for state, item, walls in zip(*columns)]
    answers = keep_all("agreement", fresh_distance, lifts, n_jobs)
    frame["full"] = pd.Series([answer.value for answer in answers], asked, "float64")
    settings = {
        "lifts": len(frame),
        "situations": int(frame["situation"].nunique()),
        **{f"in full, {why}": int((frame["asked_full"] == why).sum()) for why in ASKED_FULL},
        "first seed": FIRST_SEED,
        "policies": list(UNLOADED_BY),
        "stages (picks)": STAGES,
        "lift table": files.digest(LIFTS_FILE),
    }
    tables, command = {NAME: frame[COLUMNS]}, f"{COMMAND} lifts"
    publish(NAME, tables, command, settings, [collected, *answers], float_format="%.6f")


def disagreements(frame: pd.DataFrame, one: str, other: str) -> pd.DataFrame:
    """The lifts that succeed in one physics and not in the other; both must be known."""
    known = frame.dropna(subset=[one, other])
    lifted = known[[one, other]] >= task.LIFT_THRESHOLD
    return known[lifted[one] != lifted[other]]


def error_bounds(frame: pd.DataFrame) -> pd.DataFrame:
    """How often two physics decide differently, and 95 % bounds on how often they may.

    Args:
        frame: see ``agreement_data``.

    Returns:
        Indexed by what is compared: ``lifts``; from how many ``states`` of a container;
        ``situations``, how many distinct ones; ``differ``, the lifts decided differently; ``low``
        and ``high``, the Clopper–Pearson interval of their share. Between ``table`` and ``local``
        each situation counts once, because both give equal situations equal answers.
    """
    once = frame.drop_duplicates("situation")
    asked, why = frame[frame["full"].notna()], frame["asked_full"]
    groups = {
        "table, local": (once, "table"),
        "table, local: three or more on top": (once[once["on_top"] >= HELD_DOWN], "table"),
        "local, full: drawn": (frame[why == "drawn"], "full"),
        "local, full: three or more on top": (asked[asked["on_top"] >= HELD_DOWN], "full"),
        "local, full: close": (frame[why == "close"], "full"),
        "local, full: all": (asked, "full"),
    }
    rows = {}
    for name, (lifts, other) in groups.items():
        differ = len(disagreements(lifts, "local", other))
        low, high = share_interval(differ, len(lifts))
        states = lifts.groupby(["seed", "picks"]).ngroups
        rows[name] = len(lifts), states, lifts["situation"].nunique(), differ, low, high
    columns = ["lifts", "states", "situations", "differ", "low", "high"]
    return pd.DataFrame(rows.values(), index=rows, columns=columns)


def collect_lifts(lifts: int, seed: int) -> tuple[list[tuple[Load, np.ndarray]], pd.DataFrame]:
    """At least so many lifts, asked of ``table``, with the lifts that ship, and of ``local``.

    Containers take turns in ``UNLOADED_BY``, with the seeds ``seed``, ``seed + 1``, …

    Returns:
        The states, of each the load and (n,) bool, which items are left; and the columns of
        ``agreement_data`` without those of ``full`` but with ``state``, an index into the states.
    """
    shipped = TablePhysics(LiftTable.load(LIFTS_FILE, ENGINES[0]), exact=True)
    asked = {"table": shipped, "local": LocalPhysics(ENGINES[0])}
    states, rows, names = [], [], list(UNLOADED_BY)
    numbers: dict[bytes, int] = {}  # of situations
    rng = np.random.default_rng([seed, 2])
    while len(rows) < lifts:
        container = len(states) // len(STAGES)
        policy = names[container % len(names)]
        named = {"policy": policy, "seed": seed + container}
        played = containers(
            UNLOADED_BY[policy], seed + container, max(STAGES) + 1, (seed + container, 1)
        )
        for picks, (env, *_) in enumerate(played):
            if picks not in STAGES:
                continue
            around, visible = Surroundings(env.load, env.present), env.visible
            on_top = [len(around.on_top(item)) for item in visible]
            kinds = np.minimum(on_top, len(WANTED) - 1)
            for kind, wanted in enumerate(WANTED):
                items = visible[kinds == kind]
                for item in rng.choice(items, min(wanted, len(items)), replace=False).tolist():
                    situation = around.situation(item)
                    number = numbers.setdefault(situation.key, len(numbers))
                    row = {"picks": picks, "state": len(states), "item": item}
                    row |= {"on_top": situation.on_top, "situation": number}
                    row |= {name: each.simulate(situation) for name, each in asked.items()}
                    rows.append(named | row)
            states.append((env.load, env.present))
    return states, pd.DataFrame(rows)


def choose_for_full(
    frame: pd.DataFrame, count: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Why each lift is asked of ``full``, "" if it is not, and how many walls are simulated.

    States are drawn, and ``PER_STATE`` lifts of each, until at least ``count`` lifts are; one
    state in ``WHOLE`` is asked about in the whole container, which takes seven times as long.
    """
    why, walls = np.full(len(frame), "", object), np.zeros(len(frame), np.int64)
    for turn, state in enumerate(rng.permutation(frame["state"].unique())):
        if (why == "drawn").sum() >= count:
            break
        rows = np.flatnonzero(frame["state"] == state)
        rows = rng.choice(rows, min(PER_STATE, len(rows)), replace=False)
        why[rows], walls[rows] = "drawn", NEAR_WALLS if turn % WHOLE else WALLS
    buried = np.flatnonzero((frame["on_top"] >= HELD_DOWN) & (why == ""))
    why[rng.choice(buried, min(count, len(buried)), replace=False)] = "buried"
    why[frame["local"].between(*CLOSE) & (why == "")] = "close"
    walls[np.isin(why, ("buried", "close"))] = NEAR_WALLS
    return why, walls


def fresh_lift(
    load: Load, present: np.ndarray, item: int, walls: int
) -> tuple[dict, tuple[Load, int]]:
    """Question and arguments of one lift in a fresh world of some walls, for ``keep_all``.

    In a world that has seen other lifts, the answer depends on them (by a millimetre or so),
    and so on the order in which the items are lifted.
    """
    near = (abs(load.walls - load.walls[item]) <= NEAR_WALLS // 2) | (walls == WALLS)
    items = np.flatnonzero(present & near)
    fields = load.positions, load.sizes, load.packages, load.walls
    left, box = Load(*(field[items] for field in fields)), int(np.searchsorted(items, item))
    boxes = code_of((left.positions, left.sizes))
    return {"settings": SETTINGS, "boxes": boxes, "item": box}, (left, box)


def fresh_distance(load: Load, item: int) -> float:
    """How far ``full`` moves an item of a load that has seen no other lift, in m."""
    physics = FullPhysics()
    physics.reset(load)
    return physics.lift(item)
