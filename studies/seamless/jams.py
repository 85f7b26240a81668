"""How many free boxes jam in a seamless wall: every box simulated, with PyBullet.

    python -m studies jams

A box is free if nothing rests on it; it jams if it is lifted by less than 0.2 m all the same. What
a case varies stands in ``Case``, the cases in ``cases``.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from unload import task
from unload.env.observation import nearest
from unload.load.boxes import BESIDE, CONTACT_TOLERANCE, Load
from unload.load.substacks import stack_load
from unload.physics.bullet import ITERATIONS, TIME_STEP, World
from unload.physics.full import FullPhysics
from unload.physics.situation import RESOLUTION

LOADS = range(5)
FRICTIONS = (0.25, 0.36, 0.49, 0.64, 1.0)  # of a contact; Bullet's own is 0.25 here
GAPS = (0.0, 0.0001, 0.0005, 0.001)  # m
MOST_LIFTS = 24  # of a whole container, which takes four times as long as three walls
PERSISTENCE = (0, 1, 5, 20)  # boxes that are taken out between two lifts of the same one


@dataclass(frozen=True)
class Case:
    """A load in a world, and when its free boxes are lifted.

    Attributes:
        load: seed of the load.
        walls: that stand in the container, the rear ones taken out; 12 are all.
        friction: of a contact between two boxes, or of a box and the container.
        gap: m between boxes side by side and in front of each other; negative if they are too wide.
        spread: standard deviation of the boxes' widths, m.
        picks: boxes that have been taken out before, at random among the visible free ones.
        again: s that the load settles after that.
        settle: s that the full load settles first.
        time_step, iterations, maximal: of the solver, see ``World``.
    """

    load: int
    walls: int = 3
    friction: float = 0.49
    gap: float = 0.0
    spread: float = 0.0
    picks: int = 0
    again: float = 0.0
    settle: float = 0.5
    time_step: float = TIME_STEP
    iterations: int = ITERATIONS
    maximal: bool = True


class SeamlessPhysics(FullPhysics):
    """``FullPhysics`` with another gap, friction and solver; poses are restored after a lift."""

    def __init__(self, case: Case) -> None:
        super().__init__("restore")
        self.case = case

    def _reset(self, load: Load) -> None:
        case = self.case
        world = World(case.time_step, case.maximal, case.iterations)
        # Bullet multiplies the friction of the two bodies.
        world.add_box = partial(world.add_box, friction=case.friction**0.5)
        widths = np.random.default_rng(case.load).normal(0, case.spread, len(load))
        gaps = np.array([case.gap, case.gap, 0.0])
        sizes = np.rint(load.sizes / RESOLUTION) * RESOLUTION
        self._fill(load, world, sizes - gaps + np.stack([0 * widths, widths, 0 * widths], axis=1))


def load_of(case: Case) -> Load:
    """The foremost walls of one of the paper's loads, moved to the rear of the container."""
    load = stack_load(np.random.default_rng(case.load))
    count = int(load.walls.max()) + 1
    kept = load.walls >= count - case.walls
    depth = task.CONTAINER[0] / count
    shift = np.array([depth * (count - case.walls), 0.0, 0.0])
    arrays = (load.positions - shift, load.sizes, load.packages, load.walls)
    return Load(*(each[kept] for each in arrays))


def visible_free(load: Load, present: np.ndarray) -> np.ndarray:
    """The boxes of a load that are observed and have nothing on top, ascending."""
    there = np.flatnonzero(present)
    seen = there[nearest(load.positions[there])]
    return np.sort(seen[~load.covered(present)[seen]])


def prepared(case: Case, rng: np.random.Generator) -> SeamlessPhysics:
    """The world of a case at the moment of its lifts."""
    physics = SeamlessPhysics(case)
    physics.reset(load_of(case))
    physics.settle(case.settle)
    for _ in range(case.picks):
        physics.remove(rng.choice(visible_free(physics.load, physics.present)))
    if case.again:
        physics.settle(case.again)
    return physics


def lifts(case: Case) -> list[dict]:
    """Lift the visible free boxes of a case one by one; all poses are restored after each.

    Returns:
        A row per box: what ``place`` says of it, and the ``distance`` it was lifted, in m.
    """
    rng = np.random.default_rng((case.load, case.picks))
    physics = prepared(case, rng)
    boxes = visible_free(physics.load, physics.present)
    if case.walls > 3 and len(boxes) > MOST_LIFTS:
        boxes = np.sort(rng.choice(boxes, MOST_LIFTS, replace=False))
    rows = [
        place(physics.load, physics.present, box) | {"distance": physics.lift(int(box))}
        for box in boxes
    ]
    physics.close()
    return rows


def place(load: Load, present: np.ndarray, box: int) -> dict:
    """Where a box stands.

    Returns:
        ``box``, its row in the load; ``wall``, 0 for the foremost one; ``edge``, whether it touches
        a side wall; ``covered``, whether a present box stands in front of it; ``beside``, how many
        touch its sides.
    """
    low, high = load.positions - load.sizes / 2, load.positions + load.sizes / 2
    width = task.CONTAINER[1]
    edge = low[box, 1] <= CONTACT_TOLERANCE or high[box, 1] >= width - CONTACT_TOLERANCE
    over = (low[:, 1:] < high[box, 1:] - CONTACT_TOLERANCE).all(axis=1)
    over &= (high[:, 1:] > low[box, 1:] + CONTACT_TOLERANCE).all(axis=1)
    behind = over & present & (np.abs(low[:, 0] - high[box, 0]) <= CONTACT_TOLERANCE)
    return {
        "box": int(box),
        "wall": int(load.walls.max() - load.walls[box]),
        "edge": bool(edge),
        "covered": bool(behind.any()),
        "beside": int(present[load.contacts.of(BESIDE, box)].sum()),
    }


def persistence(case: Case) -> list[dict]:
    """Lift half of the visible free boxes at once again, and after others have been taken out.

    Returns:
        A row per box and number of others that were taken ``out``: how far it was lifted ``before``
        any, and the ``distance`` after, both in m.
    """
    rng = np.random.default_rng((case.load, 1))
    physics = prepared(case, rng)
    boxes = visible_free(physics.load, physics.present)
    boxes = np.sort(rng.choice(boxes, len(boxes) // 2, replace=False))
    before = {int(box): physics.lift(int(box)) for box in boxes}
    rows, out = [], 0
    for wanted in PERSISTENCE:
        while out < wanted:
            others = np.setdiff1d(visible_free(physics.load, physics.present), boxes)
            physics.remove(rng.choice(others))
            out += 1
        if wanted and case.again:
            physics.settle(case.again)
        for box, distance in before.items():
            row = {"box": box, "out": wanted, "before": distance}
            rows.append(row | {"distance": physics.lift(box)})
    physics.close()
    return rows


def cases() -> Iterator[tuple[str, Case]]:
    """All cases in the order of their computation, each with the question that it is for."""
    for load in LOADS:
        base = Case(load)
        for gap in (0.0, 0.0001):
            for friction in FRICTIONS:
                yield "fresh", replace(base, gap=gap, friction=friction)
        for friction in FRICTIONS[1:]:
            for again in (0.0, 0.5):
                yield "lasting", replace(base, friction=friction, again=again)
        for picks in (25, 75):
            for again in (0.0, 0.5):
                for friction in (0.49, 1.0):
                    yield "episode", replace(base, friction=friction, picks=picks, again=again)
        for gap in GAPS[2:]:
            for friction in FRICTIONS:
                yield "fresh", replace(base, gap=gap, friction=friction)
        for gap in (-0.0001, -0.0002):
            for friction in (0.25, 0.49):
                yield "width", replace(base, gap=gap, friction=friction)
        for spread in (0.00002, 0.00005, 0.0001):
            for friction in (0.25, 0.49):
                yield "width", replace(base, spread=spread, friction=friction)
        for changed in (
            {"time_step": 1 / 120}, {"time_step": 1 / 480}, {"iterations": 20},
            {"iterations": 200}, {"settle": 0.0}, {"settle": 2.0}, {"maximal": False},
        ):  # fmt: skip
            yield "solver", replace(base, **changed)
    for load in LOADS:
        for friction in (0.49, 1.0, 0.25):
            yield "container", Case(load, walls=12, friction=friction)
        yield "container", Case(load, walls=12, friction=0.49, gap=0.001)
        yield "container", Case(load, walls=12, friction=0.49, picks=200)


def answer(kind: str, case: Case) -> list[dict]:
    """The rows of a case: of ``persistence`` for the question "lasting", else of ``lifts``."""
    return persistence(case) if kind == "lasting" else lifts(case)
