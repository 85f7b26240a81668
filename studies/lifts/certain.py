"""Where is the answer to a lift certain? Loads that never repeat, asked of table and engines.

    python -m studies certain

A box with others on it is held down for certain, or simulated: ``TablePhysics`` decides which. The
bounds of its rules (``table.MIDDLE`` and those below it) were chosen on the lifts of one part and
thousands like them. All others were drawn after that: a second part like the first, a third of the
answer that is rare, and a fourth of lifts that no rule answers. Both engines lift each box to the
end, and what an empty table says by each stands beside it.
"""

from collections.abc import Iterator
from itertools import islice

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from studies.lifts.own_loads import FAMILIES
from studies.results import COMMAND, measured, publish
from studies.statistics import share_interval
from studies.style import styled
from unload import task
from unload.env import observation
from unload.load.boxes import Load
from unload.physics import table
from unload.physics.bullet import ENGINES
from unload.physics.local import LocalPhysics, settings_of_lifts
from unload.physics.situation import Situation, Surroundings
from unload.physics.table import HELD_DOWN, MIDDLE, LiftTable, TablePhysics, held_by_rule

NAME = "certain_lifts"
# First seed of a part, and how many lifts of each family; no other data uses these seeds.
PARTS = {
    "bounds": (1_100_000, 100), "drawn anew": (8_100_000, 600), "rare": (8_500_000, 150),
    "simulated": (8_900_000, 1_000),
}  # fmt: skip
PER_LOAD = 25  # lifts of a load, at most
ASKED = 0.2  # share of the failing picks that are asked about
# Besides the families: boxes of any proportions, one or two on another, which stands alone or not.
STACKS = ("made-up stacks", "made-up stacks between others")
# Parts that are drawn from some families alone, and have one answer before anything is simulated.
ONLY = {
    "rare": (("bricked walls", STACKS[1]), "between others"),
    "simulated": (("bricked walls", "crossed layers", *STACKS), "given up early"),
}
EDGES = (0.05, 1.5)  # m, of boxes of these stacks
MAX_OFFSET = 1.2  # half edges, the mean of their centres along x and along y
COLUMNS = [
    "part", "family", "on_top", "farthest", "answer", *ENGINES,
    *(f"table_{engine}" for engine in ENGINES),
]  # fmt: skip
COLOURS = dict(zip((*FAMILIES, *STACKS), ("C0", "C1", "C2", "C3", "C4", "#e377c2")))
BOUNDS = ("middle", "smallest", "covered", "flat", "hardly")  # see ``physics.table``
ANSWERS = (
    "three or more on top", "on its middle", "between others", "given up early",
    "simulated to the end",
)  # fmt: skip


def certain_data() -> None:
    """Ask about all lifts of all parts: ``certain_lifts.csv``, a row each.

    ``on_top`` is the number of boxes on the chosen one. ``farthest`` says how far the centre of the
    farthest of them is from its middle, in half edges. ``answer`` is how the table answers, by
    PyBullet. Then follow how far each engine moves the box in m, if it lifts it to the end, and
    what a table by each engine says. No situation is asked about twice.
    """
    lifts = measured(ask_all)
    settings = {engine: settings_of_lifts(engine) for engine in ENGINES}
    settings |= {
        **{name: getattr(table, name.upper()) for name in BOUNDS},
        "first seed and lifts of each family": PARTS,
    }
    publish(NAME, {NAME: lifts.value}, f"{COMMAND} certain", settings, [lifts], float_format="%.6f")


def ask_all() -> pd.DataFrame:
    """The rows of ``certain_lifts.csv``."""
    exact = {engine: LocalPhysics(engine) for engine in ENGINES}
    tables = {f"table_{engine}": TablePhysics(LiftTable(engine)) for engine in ENGINES}
    rows, seen = [], set()
    for part, (seed, lifts) in PARTS.items():
        families, answer = ONLY.get(part, ((*FAMILIES, *STACKS), None))
        for family in families:
            asked = _stacks(family, seed) if family in STACKS else _blocked(family, seed)
            asked = (each for each in asked if each.key not in seen)
            if answer is not None:
                asked = (each for each in asked if _answer(each, 0.0) == answer)
            for situation in islice(asked, lifts):
                seen.add(situation.key)
                said = {name: each.simulate(situation) for name, each in (exact | tables).items()}
                row = {"part": part, "family": family, "on_top": situation.on_top, **said}
                row["farthest"] = _farthest(situation)
                row["answer"] = _answer(situation, row["table_pybullet"])
                rows.append(row)
    return pd.DataFrame(rows)[COLUMNS]


def by_answer(frame: pd.DataFrame) -> pd.DataFrame:
    """Are the answers right? A row per way to answer, and one for all.

    Returns:
        ``lifts``; by engine the ``largest`` distance, in m, of a box that the table says is held
        down, if it is lifted to the end; by engine how many the table decides otherwise, which is
        ``wrong``; and the upper end, ``at most``, of the 95 % interval of PyBullet's share of them.
    """
    groups = [(name, frame[frame["answer"] == name]) for name in ANSWERS] + [("all", frame)]
    rows: dict[str, dict] = {}
    for name, group in groups:
        row: dict[str, float] = {"lifts": len(group)}
        for engine in ENGINES:
            held = group[f"table_{engine}"] < task.LIFT_THRESHOLD
            row[f"largest, {engine}"] = group.loc[held, engine].max()
            row[f"wrong, {engine}"] = (held != (group[engine] < task.LIFT_THRESHOLD)).sum()
        row["at most"] = share_interval(int(row["wrong, pybullet"]), len(group))[1]
        rows[name] = row
    return pd.DataFrame(rows).T.astype({"lifts": int} | {f"wrong, {each}": int for each in ENGINES})


@styled
def over_middle(frame: pd.DataFrame) -> Figure:
    """How far PyBullet lifts a box over how far off its middle one or two others lie on it.

    Args:
        frame: see ``certain_data``. The rule answers filled dots: those in the shaded part, and
            others that stand between two.
    """
    figure, panels = plt.subplots(1, HELD_DOWN - 1, figsize=(9, 3.6), sharex=True, sharey=True)
    for on_top, axes in enumerate(panels, 1):
        lifts = frame[frame["on_top"] == on_top]
        for family, colour in COLOURS.items():
            group = lifts[lifts["family"] == family]
            ruled = group["answer"].isin(ANSWERS[1:3])
            for some, face in ((group[ruled], colour), (group[~ruled], "none")):
                dots = {"s": 14, "edgecolor": colour, "facecolor": face, "linewidth": 0.7}
                label = family if face == "none" else None
                axes.scatter(some["farthest"], some[ENGINES[0]], label=label, **dots)
        axes.axvspan(0, MIDDLE, color="0.93", zorder=0)
        axes.axhline(task.LIFT_THRESHOLD, color="C5", ls="--", lw=1, label="threshold")
        axes.set(xlim=(0, 2), xlabel="farthest centre off the middle (half edges)")
        axes.set_title("one box on top" if on_top == 1 else f"{on_top} boxes on top", fontsize=9)
    panels[0].set_ylabel("distance moved (m)")
    panels[0].legend(fontsize=7, labelspacing=0.25)
    return figure


def _answer(situation: Situation, distance: float) -> str:
    """Which of ``ANSWERS`` the table gave to a box that others lie on."""
    if situation.on_top >= HELD_DOWN:
        return ANSWERS[0]
    if held_by_rule(np.frombuffer(situation.key, np.int32)):
        return ANSWERS[1 if _farthest(situation) <= MIDDLE else 2]
    return ANSWERS[4] if distance else ANSWERS[3]


def _centres(situation: Situation) -> np.ndarray:
    """The centres of the boxes on top, (n, 2): 0 is the middle of the chosen one, 1 its edge."""
    return situation.boxes[1 : situation.dynamic, :2] / (situation.boxes[0, 3:5] / 2)


def _farthest(situation: Situation) -> float:
    """How far the farthest of these centres is from the middle, in half edges."""
    return np.hypot(*_centres(situation).T).max()


def _blocked(family: str, seed: int) -> Iterator[Situation]:
    """Situations of boxes with others on them, as random picks in loads of a family meet them."""
    while True:
        rng = np.random.default_rng([seed, list(FAMILIES).index(family)])
        load = FAMILIES[family](rng)
        yield from _met(load, rng)
        seed += 1


def _met(load: Load, rng: np.random.Generator) -> Iterator[Situation]:
    """Some of the failing picks while a load is unloaded at random: a box is free, or it stays."""
    around, met = Surroundings(load, np.ones(len(load), bool)), 0
    while met < PER_LOAD and around.present.any():
        left = np.flatnonzero(around.present)
        item = int(rng.choice(left[observation.nearest(load.positions[left])]))
        if not around.on_top(item):
            around.present[item] = False
        elif rng.random() < ASKED:
            met += 1
            yield around.situation(item)


def _stacks(kind: str, seed: int) -> Iterator[Situation]:
    """Boxes of any proportions on the floor, each with one or two boxes of any proportions on it.

    Of two, one stands on the other or beside it. Those of the second kind stand between two more
    boxes on the floor.
    """
    rng = np.random.default_rng([seed, len(FAMILIES) + STACKS.index(kind)])
    while True:
        boxes = np.zeros((rng.integers(2, 4), 6))
        boxes[:, 3:] = _sizes(rng, len(boxes))
        tower = rng.random() < 0.5
        for row in range(1, len(boxes)):
            base = boxes[row - 1 if tower else 0]
            reach = (base[3:5] + boxes[row, 3:5]) / 2 - 0.002  # m, of a shared stretch at least
            boxes[row, :2] = base[:2] + rng.uniform(-1, 1, 2) * reach
            boxes[row, 2] = base[2] + (base[5] + boxes[row, 5]) / 2
        dynamic = len(boxes)
        if kind == STACKS[1]:
            boxes = np.vstack([boxes, _neighbours(rng, boxes[0, 3:])])

        floor = round(-boxes[0, 5] / 2 * 1e6)
        made = Situation(np.rint(boxes * 1e6).astype(np.int32), dynamic, floor, ())
        apart = np.abs(boxes[:, None, :3] - boxes[:, :3]) - (boxes[:, None, 3:] + boxes[:, 3:]) / 2
        overlaps = (apart < -1e-9).all(axis=-1).sum() > len(boxes)  # each with itself
        if not overlaps and np.abs(_centres(made).mean(axis=0)).max() <= MAX_OFFSET:
            yield made


def _neighbours(rng: np.random.Generator, size: np.ndarray) -> np.ndarray:
    """A box to the left of one at the origin and one to its right, (2, 6) in m.

    Half of these pairs cover its sides, as in a wall; the others lie anywhere.
    """
    boxes = np.zeros((2, 6))
    boxes[:, 3:] = _sizes(rng, 2)
    if rng.random() < 0.5:
        boxes[:, 3], boxes[:, 5] = size[0], size[2]
    else:
        boxes[:, 0] = rng.uniform(-1, 1, 2) * (size[0] + boxes[:, 3]) / 2
    boxes[:, 1] = (size[1] + boxes[:, 4]) / 2 * (-1, 1)
    boxes[:, 2] = (boxes[:, 5] - size[2]) / 2
    return boxes


def _sizes(rng: np.random.Generator, count: int) -> np.ndarray:
    """Edge lengths of so many boxes, (count, 3) in m."""
    return np.exp(rng.uniform(*np.log(EDGES), (count, 3)))
