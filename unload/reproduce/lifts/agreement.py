"""Do the three physics agree? The same lifts, asked of ``table``, ``local`` and ``full``.

    python -m unload.reproduce lifts

Containers are unloaded by several policies, from seeds that nothing else uses. At several
stages some of the visible items are lifted, each from the same state; most of them are
hard cases, with one or two boxes on top. ``full`` is slow and asked about some lifts only:
a few of each of many states, drawn without looking at any answer; as many with three or more
boxes on top, which ``table`` answers without a simulation; and all that are close, for which
``local`` finds a distance near the threshold. These worlds are fresh; what drift does to the picks
of a policy, ``unload.reproduce.policies.robustness`` tells.
"""

from collections.abc import Iterator
from functools import partial
from hashlib import blake2b
from pathlib import Path

import gymnasium
import numpy as np
import pandas as pd

from unload import task
from unload.agent import policies
from unload.load.substacks import WALLS
from unload.physics.local import LocalPhysics
from unload.physics.table import HELD_DOWN, LIFTS_FILE, TablePhysics, shared_table
from unload.reproduce.lifts.full import NEAR_WALLS, State, fresh_job
from unload.reproduce.results import COMMAND, keep_all, measured, publish, read_table
from unload.reproduce.statistics import share_interval
from unload.support import checks, files

NAME = "lift_agreement"
LIFT_COUNT, FULL_COUNT = 5000, 300  # compared in table and local, and drawn for full
FRESH = 1_000_000  # seed of the first container; no other data uses it or the next ones
STAGES = (0, 100, 200, 300, 400, 500)  # picks after which items are lifted
WANTED = (2, 4, 4, 2)  # lifts per state with 0, 1, 2, and 3 or more boxes on top
PER_STATE = 3  # lifts of a state that are drawn for full
WHOLE = 5  # of every so many states drawn, one is asked about in the whole container
CLOSE = (0.1, 0.3)  # m, distances in local that count as close to the threshold
ASKED_FULL = ("drawn", "buried", "close")
COLUMNS = [
    "policy", "seed", "picks", "item", "on_top", "situation", "known",
    "asked_full", "walls", "table", "local", "full",
]  # fmt: skip
UNLOADED_BY = {
    "random": policies.random,
    "nearest": policies.nearest,
    "highest": policies.highest,
    "mixed": policies.mixed(policies.highest, 0.3),
}


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
        full: how many of these at least are drawn for ``full``, and how many more of those
            with three or more boxes on top; the close ones come on top.
        seed: of the first container.
        folder: of the data.
        runs_dir: where the answers of ``full`` are kept.
        n_jobs: processes for ``full``, as in joblib.
        progress: show a progress bar.

    Returns:
        See ``read_agreement``.

    Raises:
        TypeError, ValueError: a number is not as described.
        FileNotFoundError: there is no lift table.
    """
    checks.integer("full", full, 0, checks.integer("lifts", lifts, 1))
    runs_dir, rng = Path(runs_dir) / "agreement", np.random.default_rng(seed)
    asker = Asker()
    (states, frame), record = measured(partial(collect_lifts, lifts, seed, asker))
    frame["asked_full"], frame["walls"] = choose_for_full(frame, full, rng)
    asked = frame.index[frame["asked_full"] != ""]
    columns = (frame.loc[asked, name] for name in ("state", "item", "walls"))
    jobs = [fresh_job(states[state], item, walls) for state, item, walls in zip(*columns)]
    answers = keep_all(runs_dir, jobs, n_jobs, progress)
    frame["full"] = pd.Series([answer.value for answer in answers], asked, "float64")
    asker.close()
    settings = {
        "lifts": len(frame),
        "situations": int(frame["situation"].nunique()),
        **{f"in full, {why}": int((frame["asked_full"] == why).sum()) for why in ASKED_FULL},
        "first seed": seed,
        "policies": list(UNLOADED_BY),
        "stages (picks)": STAGES,
        "lift table": table_digest(),
    }
    publish(
        folder,
        NAME,
        {NAME: frame[COLUMNS]},
        f"{COMMAND} lifts",
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
        ``table``, ``local`` and ``full`` are how far the box moved in m, NaN where ``full``
        was not asked.

        Of ``full``: ``asked_full`` says why it was asked, "drawn", "buried" or "close", and is
        empty where it was not; ``walls`` is how many item walls it simulated, 0 for none, 5 for
        the item's own and two on each side, 12 for the whole container.

    Raises:
        FileNotFoundError: there is no such file.
    """
    frame = read_table(Path(folder) / f"{NAME}.csv", f"{COMMAND} lifts", COLUMNS)
    return frame.fillna({"asked_full": ""})


def disagreements(frame: pd.DataFrame, one: str, other: str) -> pd.DataFrame:
    """The lifts that succeed in one physics and not in the other; both must be known."""
    checks.one_of("one", one, ("table", "local", "full"))
    checks.one_of("other", other, ("table", "local", "full"))
    known = frame[frame[one].notna() & frame[other].notna()]
    lifted = known[[one, other]] >= task.LIFT_THRESHOLD
    return known[lifted[one] != lifted[other]]


def error_bounds(frame: pd.DataFrame) -> pd.DataFrame:
    """How often two physics decide differently, and 95 % bounds on how often they may.

    Args:
        frame: see ``read_agreement``.

    Returns:
        Indexed by what is compared: ``lifts``; from how many ``states`` of a container;
        ``situations``, how many distinct ones; ``differ``, the lifts decided differently; ``low``
        and ``high``, the Clopper–Pearson interval of their share. Between ``table`` and ``local``
        each situation counts once, because both give equal situations equal answers.
    """
    once = frame.drop_duplicates("situation")
    asked, why = frame[frame["asked_full"] != ""], frame["asked_full"]
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
        if lifts.empty:
            continue
        differ = len(disagreements(lifts, "local", other))
        low, high = share_interval(differ, len(lifts))
        rows[name] = {
            "lifts": len(lifts),
            "states": lifts.groupby(["seed", "picks"]).ngroups,
            "situations": lifts["situation"].nunique(),
            "differ": differ,
            "low": low,
            "high": high,
        }
    return pd.DataFrame(rows.values(), index=rows)


def table_digest() -> str:
    """Name of the lift table that ships: a digest of its file."""
    return blake2b(LIFTS_FILE.read_bytes(), digest_size=8).hexdigest()


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


class Asker:
    """The same lifts asked of ``table``, with the lifts that ship, and of ``local``."""

    def __init__(self) -> None:
        self.table, self.local = TablePhysics(shared_table()), LocalPhysics()
        self._numbers: dict[bytes, int] = {}  # of situations

    def enter(self, state: State) -> None:
        """Bring both to a state."""
        for physics in (self.table, self.local):
            physics.reset(state.load)
        for item in np.flatnonzero(~state.present):
            self.remove(item)

    def remove(self, item: int) -> None:
        """Take an item out of both."""
        self.table.remove(item)
        self.local.remove(item)

    def on_top(self, item: int) -> int:
        """Number of boxes on an item."""
        return len(self.local.surroundings.on_top(item))

    def lift(self, item: int) -> dict:
        """Row of a lift: its item, its situation and both answers."""
        situation = self.local.surroundings.situation(item)
        before = len(self.table.table)
        distances = {"table": self.table.lift(item), "local": self.local.lift(item)}
        return {
            "item": item,
            "on_top": situation.on_top,
            "situation": self._numbers.setdefault(situation.key, len(self._numbers)),
            "known": len(self.table.table) == before,
        } | distances

    def close(self) -> None:
        """Free both."""
        self.table.close()
        self.local.close()


def collect_lifts(lifts: int, seed: int, asker: Asker) -> tuple[list[State], pd.DataFrame]:
    """At least so many lifts, asked of ``table`` and ``local``.

    Containers take turns in ``UNLOADED_BY``, with the seeds ``seed``, ``seed + 1``, …

    Returns:
        The states, and the columns of ``read_agreement`` without those of ``full`` but
        with ``state``, an index into the states.
    """
    states, rows, names = [], [], list(UNLOADED_BY)
    rng = np.random.default_rng([seed, 2])
    while len(rows) < lifts:
        container = len(states) // len(STAGES)
        for state in container_states(names[container % len(names)], seed + container):
            asker.enter(state)
            named = {"state": len(states), **_name(state)}
            rows += [named | asker.lift(item) for item in choose_items(state, asker, rng)]
            states.append(state)
    return states, pd.DataFrame(rows)


def _name(state: State) -> dict:
    return {"policy": state.policy, "seed": state.seed, "picks": state.picks}


def choose_items(state: State, asker: Asker, rng: np.random.Generator) -> list[int]:
    """Some visible items, as many of each kind as ``WANTED`` says or as there are."""
    kinds = np.array([min(asker.on_top(item), len(WANTED) - 1) for item in state.visible])
    chosen = []
    for kind, wanted in enumerate(WANTED):
        items = state.visible[kinds == kind]
        chosen += rng.choice(items, min(wanted, len(items)), replace=False).tolist()
    return chosen


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
    if count:
        why[frame["local"].between(*CLOSE) & (why == "")] = "close"
    walls[np.isin(why, ("buried", "close"))] = NEAR_WALLS
    return why, walls
