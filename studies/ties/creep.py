"""How far boxes creep in a world that goes on, and how long the order among equals lasts.

    python -m studies creep

Every box is simulated by PyBullet, and nothing is put back: what a pick moves stays moved, and
while a box is pulled the others go on to creep. Observed are boxes that nobody touches.
"""

from collections.abc import Iterator
from dataclasses import asdict, dataclass

import numpy as np
import pandas as pd
from scipy.stats import spearmanr

from studies.results import COMMAND, keep_all, publish
from studies.seamless.jams import Case, SeamlessPhysics, load_of
from unload import task
from unload.env.observation import nearest
from unload.physics.bullet import GAP
from unload.physics.situation import Surroundings

PICKS = 120
CONTAINER_PICKS = 60  # of a whole container, which takes an hour
LAGS = (1, 2, 5, 10, 20, 40, 60, 120)  # picks
EVERY = 20  # picks between two moments from which on boxes are followed
FEWEST = 4  # boxes at the same place along an axis, of which an order is compared
SETTLE = 0.5  # s
FRICTION = 0.25  # of a contact, as everywhere in the package


@dataclass(frozen=True)
class World:
    """A load in a world, and who picks.

    Attributes:
        load: seed of the load.
        walls: that stand in the container, 12 are all.
        gap: between boxes side by side, m.
        policy: ``"random"`` picks any visible box, ``"highest"`` the highest one.
    """

    load: int
    walls: int = 3
    gap: float = GAP
    policy: str = "highest"


def worlds() -> Iterator[World]:
    """All of them in the order of their computation."""
    for load in range(5):
        for policy in ("highest", "random"):
            yield World(load, policy=policy)
    for load in range(2):
        for gap in (0.0005, 0.002):
            yield World(load, gap=gap)
    yield World(0, walls=12)


def play(world: World) -> dict[str, list]:
    """Pick on, and note after each pick where the boxes are.

    Returns:
        ``offsets``: (picks + 1, boxes, 3) in micrometres, how far each box is from where the load
        put it, of which the first is before any pick; ``touched``: (boxes,), the pick at which a
        box was first pulled at, or stood on a box that was, or was unloaded; -1 if never.
    """
    case = Case(world.load, world.walls, FRICTION, world.gap)
    rng, physics = np.random.default_rng((world.load, 7)), SeamlessPhysics(case)
    physics.after_pick = "keep"
    load = load_of(case)
    physics.reset(load)
    physics.settle(SETTLE)
    touched, around = np.full(len(load), -1), Surroundings(load, np.ones(len(load), bool))
    offsets = [physics.positions() - load.positions]
    for pick in range(PICKS if world.walls == 3 else CONTAINER_PICKS):
        there = np.flatnonzero(physics.present)
        seen = there[nearest(physics.positions()[there])]
        highest = seen[physics.positions()[seen, 2].argmax()]
        box = int(rng.choice(seen) if world.policy == "random" else highest)
        pulled = [box, *around.on_top(box)]  # present or not
        touched[pulled] = np.where(touched[pulled] < 0, pick, touched[pulled])
        if physics.lift(box) >= task.LIFT_THRESHOLD:
            physics.remove(box)
        offsets.append(physics.positions() - load.positions)
    physics.close()
    return {"offsets": np.rint(np.stack(offsets) * 1e6).tolist(), "touched": touched.tolist()}


def rows(world: World, played: dict[str, list]) -> list[dict]:
    """What is published of a world: a row per moment, lag and axis.

    ``boxes`` is the number of untouched boxes that share their place along the axis, within a
    wall, with others; ``rms`` how far they move along it meanwhile, in mm, without the mean of
    their group; ``spearman`` the mean rank correlation of their offsets then and later.
    """
    load = load_of(Case(world.load, world.walls))
    offsets, touched = np.array(played["offsets"]) / 1000, np.array(played["touched"])
    found = []
    for start in range(0, len(offsets), EVERY):
        for lag in LAGS:
            if start + lag >= len(offsets):
                continue
            left = (touched < 0) | (touched >= start + lag)
            for axis, name in enumerate("xyz"):
                groups = list(equals(load, axis, left))
                if not groups:
                    continue
                before = [offsets[start, group, axis] for group in groups]
                after = [offsets[start + lag, group, axis] for group in groups]
                sizes = np.array([len(group) for group in groups])
                moved = [b - a - (b - a).mean() for a, b in zip(before, after)]
                orders = [spearmanr(a, b).statistic for a, b in zip(before, after)]
                found.append({
                    **asdict(world), "pick": start, "lag": lag, "axis": name,
                    "boxes": int(sizes.sum()),
                    "rms": float(np.sqrt(np.mean(np.concatenate(moved) ** 2))),
                    "spearman": float(np.average(orders, weights=sizes)),
                })  # fmt: skip
    return found


def equals(load, axis: int, left: np.ndarray) -> Iterator[np.ndarray]:
    """The groups of boxes of a wall that share their place along an axis."""
    places = np.rint(load.positions[:, axis] * 1e4)
    for wall in np.unique(load.walls):
        inside = left & (load.walls == wall)
        for place in np.unique(places[inside]):
            group = np.flatnonzero(inside & (places == place))
            if len(group) >= FEWEST:
                yield group


def durations(table: pd.DataFrame) -> pd.DataFrame:
    """Means of what ``rows`` say of the package's gap, by ``walls``, ``axis`` and ``lag``."""
    usual = table[table["gap"] == GAP]
    return usual.groupby(["walls", "axis", "lag"])[["boxes", "rms", "spearman"]].mean()


def creep_data(n_jobs: int = -1) -> None:
    """Play in all worlds; write ``ties/noise.csv``, see ``rows``."""
    asked = [(asdict(world), (world,)) for world in worlds()]
    results = keep_all("ties/creep", play, asked, n_jobs)
    found = [row for world, result in zip(worlds(), results) for row in rows(world, result.value)]
    settings = {"worlds": len(asked), "picks": PICKS, "settle": SETTLE, "friction": FRICTION}
    publish("ties/noise", {"noise": pd.DataFrame(found)}, f"{COMMAND} creep", settings, results)
