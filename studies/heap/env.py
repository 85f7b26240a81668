"""The heap as a Gymnasium environment."""

import gymnasium
import numpy as np

from studies.heap.boxes import Heap
from studies.heap.generate import stored_heaps
from studies.heap.observation import COLUMNS, FELL, ROWS, UNLOADED, Camera, features, visible_boxes
from studies.heap.rake import Outcome, Rake
from unload.env.base import EpisodeEnv
from unload.support import checks

MAX_PICKS = 15  # they unload some 25 to 40 of 100 boxes, the front of the heap
LARGEST = 20.0  # of the observation: twice what a box 10 m away would show


class HeapEnv(EpisodeEnv):
    """Unload a heap by choosing, at each step, the box that a rake drags.

    ## Description
    About 100 boxes of the paper's 13 packages lie in any orientation in the last 3 m of the
    container, between the rear wall at x = 4 m and the door at 7 m. The rake drags the chosen
    box towards the door, at 1 m/s, with at most 60 N (the weight of six boxes), for 0.7 m (the
    longest edge of a box) or 1 s. The box came if it moved 0.63 m, nine tenths of that. Other
    boxes are pushed, carried or lose their support. The conveyor's edge stands at the foremost
    face of the heap, where it cannot count boxes that creep by millimetres, but never more
    than 0.2 m outside the door: it does not give way to boxes that come out. After 0.5 s of
    rest, in which a box falls by 1.2 m, boxes whose centre is beyond the edge are unloaded; so
    is the dragged one if it came. Rest and unloading are repeated, four times at most, until
    nothing more is unloaded and no box is faster than 0.2 m/s: a toppling box is, a creeping
    one is not. The other boxes stay as physics has left them; the next pick begins at rest.

    ## Action space
    ``Discrete(96)``: the row of the observation to drag. A row without a box is a pick that
    fails and changes nothing. A row that is masked may be dragged again.

    ## Observation space
    ``Box(-20, 20, (96, 13), float32)``: one row for each visible box, from the door to the
    rear; rows without a box are 0. A box is visible if a camera of 128 × 96 pixels, 2 m
    outside the door and 2.4 m high, shows at least four pixels of it. That is true of about 55
    boxes. No row tells of hidden boxes, unless none is visible: then there is a row for each.

    ======  ===============================================================================  ====
    Column  Observation                                                                      unit
    ======  ===============================================================================  ====
    0       distance of the centre behind the conveyor's edge, by the foremost visible face  m
    1       y of the centre, from the middle                                                 m
    2       z of the centre                                                                  m
    3–5     extents of the upright block around the box, along x, y, z                       m
    6–8     edges of the box, longest first                                                  m
    9       tilt: angle between the vertical and the nearest axis of the box                 rad
    10      share of the block's top that no visible block covers                            1
    11      share of the block's front that no visible block covers                          1
    12      visible pixels                                                                   1000
    ======  ===============================================================================  ====

    ## Rewards
    Boxes unloaded by the pick, less the other boxes that dropped by more than 0.5 m, and may be
    damaged: the price of a fall is λ = 1. ``info`` has both, for another price.

    ## Starting state
    One of the stored heaps of the split, drawn with equal probability.

    ## Episode end
    Termination when the last box is unloaded, truncation after ``max_picks`` picks.

    ## Information
    ``reset`` and ``step`` return a dict with

    - ``action_mask``: (96,) int8, 0 for rows without a box, and for boxes that did not come
      since the last pick that unloaded something (if that is all of them, they are allowed
      again);
    - ``item_mask``: (96,) int8, 0 for rows without a box;

    and ``step`` also

    - ``unloaded`` and ``falls``: int, the two parts of the reward;
    - ``box``: int, the dragged box's number in the heap before the pick, -1 if there was none;
    - ``fates``: (96,) int8, what happened to the box in each row of the observation before the
      pick: 1 if it was unloaded, 2 if it fell, 3 if both, 0 if neither.

    ## Arrays
    There is no array of heaps, because nearly all of a pick is PyBullet's time;
    ``gymnasium.make_vec(id, n, vectorization_mode="async")`` gives each heap a process.

    Args:
        split: ``"train"`` or ``"test"``, which of the stored heaps are played.
        physics: ``"whole"`` or ``"coarse"``, see ``Rake``.
        max_picks: greatest length of an episode.

    Attributes:
        heap: the ``Heap`` as it is.
        heaps: those of the split.
        outcome: what the last pick has done, box by box; None before the first.
        visible: (96,) int64, the box in each row of the observation, -1 in rows without.

    Raises:
        TypeError, ValueError: an argument or an action is not as described.
        FileNotFoundError: the stored heaps are missing.
        gymnasium.error.ResetNeeded: ``step`` before ``reset``, or after an episode's end.
        gymnasium.error.ClosedEnvironmentError: use after ``close``.
    """

    def __init__(
        self, split: str = "train", physics: str = "whole", max_picks: int = MAX_PICKS
    ) -> None:
        self.max_picks = checks.integer("max_picks", max_picks, 1)
        self.heaps = stored_heaps(split)
        self.observation_space = gymnasium.spaces.Box(
            -LARGEST, LARGEST, (ROWS, len(COLUMNS)), np.float32
        )
        self.action_space = gymnasium.spaces.Discrete(ROWS)
        self._rake, self._camera = Rake(physics), Camera()

    def reset(self, *, seed: int | None = None, options: dict | None = None):
        """Start with one of the heaps; ``options={"heap": heap}`` gives the heap to use."""
        self._check_open()
        heap = (options or {}).get("heap")
        if heap is not None and not (isinstance(heap, Heap) and len(heap)):
            raise ValueError(f"options['heap'] is {heap!r}; expected a Heap that holds a box")
        super().reset(seed=seed)
        if heap is None:
            heap = self.heaps[self.np_random.integers(len(self.heaps))]
        self._state = "broken off"  # until all is done
        self.heap, self._failed, self._picks = heap, np.zeros(len(heap), bool), 0
        self.outcome = None
        self._look()
        self._state = "running"
        return self._observation.copy(), self._info()

    def step(self, action: int):
        self._check_running()
        row = self._row(action)
        box, seen = int(self.visible[row]), self.visible >= 0
        none = np.zeros(len(self.heap), bool)
        outcome = Outcome(self.heap, none, none, 0.0, False)
        self._state = "broken off"  # until all is done
        self._picks += 1
        if box >= 0:
            outcome = self._rake.pick(self.heap, box)
            self._failed[box] = True
        fates = np.zeros(ROWS, np.int8)
        fates[seen] = (UNLOADED * outcome.unloaded + FELL * outcome.fallen)[self.visible[seen]]
        if outcome.unloaded.any():
            self._failed = np.zeros(len(outcome.heap), bool)
        self.outcome, self.heap = outcome, outcome.heap
        self._look()
        self._state = "running"
        pick = {
            "unloaded": outcome.unloaded.sum(),
            "falls": outcome.fallen.sum(),
            "box": np.int64(box),
            "fates": fates,
        }
        reward = float(pick["unloaded"] - pick["falls"])
        terminated, truncated = len(self.heap) == 0, self._picks >= self.max_picks
        if terminated or truncated:
            self._state = "finished"
        return self._observation.copy(), reward, terminated, truncated, self._info() | pick

    def close(self) -> None:
        """Let go of both clients, which disconnects them; may be called again."""
        self._rake = self._camera = None
        self._state = "closed"

    def _look(self) -> None:
        """Update which boxes are visible, and the observation of them."""
        self.visible = np.full(ROWS, -1)
        self._observation = np.zeros(self.observation_space.shape, np.float32)
        if len(self.heap):
            pixels = self._camera.pixels(self.heap)
            seen = visible_boxes(self.heap, pixels)
            self.visible[: len(seen)] = seen
            rows = features(self.heap.only(seen), pixels[seen])
            self._observation = np.clip(rows, -LARGEST, LARGEST)

    def _info(self) -> dict:
        boxes = self.visible >= 0
        untried = boxes.copy()
        untried[boxes] = ~self._failed[self.visible[boxes]]
        return {
            "action_mask": (untried if untried.any() else boxes).astype(np.int8),
            "item_mask": boxes.astype(np.int8),
        }
