"""The task on one page: what the environments do, plainly and slowly, looking at all at each pick.

The environments keep sorted orders and ranks while boxes leave. They are equal to these, by bits.
"""

import gymnasium
import numpy as np

from unload import Load, equalize, stack_load, task
from unload.env import observation
from unload.load.boxes import ABOVE, BELOW, BESIDE, CONTACT_TOLERANCE
from unload.load.substacks import build_load
from unload.physics.situation import RESOLUTION, Situation
from unload.physics.table import TablePhysics, shared_table

VARIANTS = [np.full((12, 3, 4), variant) for variant in range(3)]
GRID = np.concatenate([build_load(variants).positions for variants in VARIANTS])


def on_top(load: Load, present: np.ndarray, item: int) -> list[int]:
    """The present boxes that rest on ``item``, directly or over others, in index order."""
    resting, frontier = set(), [item]
    while frontier:
        for box in load.contacts.of(ABOVE, frontier.pop()).tolist():
            if present[box] and box not in resting:
                resting.add(box)
                frontier.append(box)
    return sorted(resting)


def situation(load: Load, present: np.ndarray, item: int) -> Situation:
    """The boxes that decide the lift of ``item``."""
    dynamic = [item, *on_top(load, present, item)]
    touching = {
        box
        for mover in dynamic
        for kind in (BELOW, BESIDE)
        for box in load.contacts.of(kind, mover).tolist()
        if present[box]
    }
    members = [*dynamic, *sorted(touching.difference(dynamic))]
    centre = load.positions[item]
    boxes = np.hstack([load.positions[members] - centre, load.sizes[members]])

    # The floor matters to the chosen box alone, a side wall to each box that moves.
    low, high = load.positions - load.sizes / 2, load.positions + load.sizes / 2
    on_floor, right, sides = low[item, 2] <= CONTACT_TOLERANCE, load.container[1], []
    if low[dynamic, 1].min() <= CONTACT_TOLERANCE:
        sides.append(-centre[1])
    if high[dynamic, 1].max() >= right - CONTACT_TOLERANCE:
        sides.append(right - centre[1])
    return Situation(
        boxes=np.rint(boxes / RESOLUTION).astype(np.int32),
        dynamic=len(dynamic),
        floor=round(-centre[2] / RESOLUTION) if on_floor else None,
        sides=tuple(round(side / RESOLUTION) for side in sides),
    )


class Plain(gymnasium.Env):
    """What both tasks share: settings, spaces, and what is seen of items."""

    def __init__(
        self, equalize=False, ties="noise", max_picks=500, position_noise=0.0005, stack=stack_load
    ):
        self.equalize, self.ties, self.max_picks = equalize, ties, max_picks
        self.position_noise, self.stack = position_noise, stack
        self.observation_space = gymnasium.spaces.Box(-1, 1, (task.N_VISIBLE, 3), np.float32)
        self.action_space = gymnasium.spaces.Discrete(task.N_VISIBLE)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.picks = 0
        self.fill(**options or {})
        return self.look(), self.info()

    def features(self, positions: np.ndarray, container: np.ndarray) -> np.ndarray:
        """The observation of items at ``positions``, nearest first; then padding."""
        seen = np.full((task.N_VISIBLE, 3), -1, np.float32)
        seen[: len(positions)] = observation.scale(positions, container)
        present = np.arange(task.N_VISIBLE) < len(positions)
        return equalize(seen, self.ties, present=present) if self.equalize else seen


class PlainContainer(Plain):
    """``unload/Container-v0``."""

    def fill(self, load: Load | None = None) -> None:
        self.load = load or self.stack(self.np_random)
        blur = observation.drift(len(self.load), self.position_noise, self.np_random)
        self.positions, self.physics = self.load.positions + blur, TablePhysics(shared_table())
        self.present, self.failed = np.ones(len(self.load), bool), np.zeros(len(self.load), bool)

    def look(self) -> np.ndarray:
        left = np.flatnonzero(self.present)
        rows = observation.nearest(self.positions[left], container=self.load.container)
        self.visible = np.full(task.N_VISIBLE, -1)
        self.visible[: len(rows)] = left[rows]
        return self.features(self.positions[left[rows]], self.load.container)

    def lift(self, item: int) -> float:
        if item < 0:
            return 0.0
        return self.physics.simulate(situation(self.load, self.present, item))

    def step(self, action: int):
        self.picks += 1
        item = int(self.visible[action])
        distance = self.lift(item)
        success = distance >= 0.2
        if success:
            self.present[item] = False
            self.failed[:] = False
        elif item >= 0:
            self.failed[item] = True
        seen, terminated = self.look(), not self.present.any()
        info = self.info() | {"item": np.int64(item), "distance": np.float64(distance)}
        return seen, 1.0 if success else -1.0, terminated, self.picks == self.max_picks, info

    def info(self) -> dict:
        held = self.visible >= 0
        return {
            "action_mask": (held & ~self.failed[self.visible]).astype(np.int8),
            "item_mask": held.astype(np.int8),
            "unloaded": np.int64((~self.present).sum()),
        }


class PlainHighestItem(Plain):
    """``unload/HighestItem-v0``."""

    def fill(self) -> None:
        self.places = GRID[self.np_random.integers(len(GRID), size=task.N_VISIBLE)]
        self.blur = observation.drift(task.N_VISIBLE, self.position_noise, self.np_random)

    def look(self) -> np.ndarray:
        rows = observation.nearest(self.places + self.blur)
        self.highest = self.places[rows, 2] > self.places[:, 2].max() - 1e-6
        return self.features((self.places + self.blur)[rows], task.CONTAINER)

    def step(self, action: int):
        self.picks += 1
        reward = 1.0 if self.highest[action] else -1.0
        self.fill()
        return self.look(), reward, False, self.picks == self.max_picks, self.info()

    def info(self) -> dict:
        return {name: np.ones(task.N_VISIBLE, np.int8) for name in ("action_mask", "item_mask")}
