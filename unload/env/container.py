"""The container as a Gymnasium environment (Sec. III-A to III-D)."""

from collections.abc import Callable

import numpy as np

from unload import task
from unload.env import observation
from unload.env.base import AllOrReset, PickingEnv, check_options, stacked
from unload.env.observation import POSITION_NOISE
from unload.load.boxes import Load, check_stack
from unload.load.substacks import stack_load
from unload.physics.base import Physics
from unload.physics.choice import Name, make_physics


class ContainerEnv(PickingEnv):
    """Unload a container by choosing, at each step, the item to pick.

    ## Description
    A container of 7.0 × 2.5 × 2.5 m holds 800–1000 boxes, stacked in walls. At each step
    the agent chooses one of the 128 boxes nearest to the entrance. It is pulled upwards
    with 20 N for 0.3 s; if it moved at least 0.2 m it is unloaded, else the container
    stays as it was. With ``max_picks`` large enough, it is unloaded to the last box.

    ## Action space
    ``Discrete(128)``: the row of the observation to pick. A row that failed before may be
    picked again, and fails again. So does a row without a box: it is a failed pick of
    item -1, which moves by 0 m, and changes nothing.

    ## Observation space
    ``Box(-1, 1, (128, 3), float32)``: centres of the 128 nearest boxes, nearest first,
    scaled to the container; with ``equalize=True`` their equalized ranks instead.

    ======  ===========  ==============  ===============
    Column  Observation  -1              1
    ======  ===========  ==============  ===============
    0       x            rear wall       entrance
    1       y            left side wall  right side wall
    2       z            floor           ceiling
    ======  ===========  ==============  ===============

    Once fewer than 128 boxes are left, they come first, and each row after them holds -1 in
    all columns, equalized or not. ``info["item_mask"]`` is 0 in these rows; so is
    ``unload.env.observation.holds_item``, if the observation is not equalized. Ranks are
    those among the boxes that are there.

    ## Rewards
    +1 if the item was unloaded, -1 if not.

    ## Starting state
    A new random load from ``stack``, each position blurred once by the drift that a full
    simulation shows (0.5 mm, and 1 mm down).

    ## Episode end
    Termination when the last box has been unloaded; nothing is left to pick then, and every
    row is padded. Truncation after ``max_picks`` picks, which is not Gymnasium's
    ``max_episode_steps``: ``spec`` has none. The paper's loads of 800 boxes or
    more are never emptied by its 500 picks.

    ## Information
    ``reset`` and ``step`` return a dict with

    - ``action_mask``: (128,) int8, 0 for rows that failed since the last successful pick,
      and for rows without a box;
    - ``item_mask``: (128,) int8, 0 for rows without a box only: for learning without the
      mask of failed rows;
    - ``unloaded``: int64, items unloaded in this episode;

    and ``step`` also

    - ``item``: int64, the picked item's number in the load, -1 if the row held none;
    - ``distance``: float64, how far it moved in m.

    Args:
        physics: what is simulated at a lift: ``"local"`` (the situation of the chosen box),
            ``"full"`` (every box, slow) or ``"table"`` (``"local"``, remembered). ``"table"``
            answers without a simulation if nothing rests on the chosen box, which then moves by
            0.463053 m, and if three boxes or more do: it moves by 0 m. Or a ``Physics`` of your
            own, which the environment leaves open.
        after_pick: for ``physics="full"``: ``"restore"`` or ``"keep"``.
        equalize: give equalized observations (Alg. 1).
        ties: see ``unload.equalize``.
        max_picks: greatest length of an episode.
        position_noise: standard deviation of the blur in m, at most 10; 0 also switches off
            the 1 mm down. It applies where the boxes stay where they were put; ``"full"``
            physics that is not restored drifts by itself, and its boxes are seen where
            they are.
        stack: makes a ``Load``, of any number of items and in a container of any size, from a
            ``numpy.random.Generator``. Each box stands on the floor or, within the load's
            ``contact_tolerance``, on another one: across a wider gap it would not hold it down.
        render_mode: ``"rgb_array"`` for pictures, or None.

    Attributes:
        visible: (128,) int64, the item in each row of the observation, -1 in rows without.

    Raises:
        TypeError, ValueError: an argument, an action or a load is not as described.
        gymnasium.error.ResetNeeded: ``step`` or ``render`` before ``reset``, ``step`` after
            the end of an episode, or any of them after an error in the middle of a call.
        gymnasium.error.ClosedEnvironmentError: use after ``close``.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 4}
    options = ("load",)

    def __init__(
        self,
        physics: Name | Physics = "local",
        after_pick: str = "restore",
        equalize: bool = False,
        ties: str = "noise",
        max_picks: int = task.MAX_PICKS,
        position_noise: float = POSITION_NOISE,
        stack: Callable[[np.random.Generator], Load] = stack_load,
        render_mode: str | None = None,
    ) -> None:
        super().__init__(equalize, ties, max_picks, position_noise, render_mode)
        check_stack(stack)
        self.stack = stack
        self.physics = make_physics(physics, after_pick)
        self._own = self.physics is not physics

    def reset(self, *, seed: int | None = None, options: dict | None = None):
        """Fill the container anew; ``options={"load": load}`` gives the load to use."""
        self._check_open()
        options = check_options(options, self.options)
        super().reset(seed=seed)
        with AllOrReset(self):
            load = options.get("load") or stacked(self.stack, self.np_random)
            self._blur = observation.drift(len(load), self.position_noise, self.np_random)
            self.physics.reset(load)
            self._failed = np.zeros(len(load), dtype=bool)
            self._picks = self._unloaded = 0
            self._state = "running"
            self._look()
            return self._observation.copy(), self._info()

    def step(self, action: int):
        """Pick the item in row ``action`` of the observation."""
        self._check_running()
        # A row without a box is a failed pick that asks no physics.
        item = int(self.visible[self._row(action)])
        distance = self.physics.lift(item) if item >= 0 else 0.0
        success = distance >= task.LIFT_THRESHOLD

        # A lift that succeeds makes all failed rows worth another try.
        with AllOrReset(self):
            self._picks += 1
            if success:
                self.physics.remove(item)
                self._unloaded += 1
                self._failed[:] = False
            elif item >= 0:
                self._failed[item] = True
            if success or not self.physics.exact:
                self._look()

            terminated = self._unloaded == len(self.physics.load)
            truncated = self._picks == self.max_picks
            if terminated or truncated:
                self._state = "finished"
        info = self._info() | {"item": np.int64(item), "distance": np.float64(distance)}
        return self._observation.copy(), 1.0 if success else -1.0, terminated, truncated, info

    def action_masks(self) -> np.ndarray:
        """(128,) bool, False for rows without a box or failed since the last successful pick."""
        self._check_started()
        return (self.visible >= 0) & ~self._failed[self.visible]

    def liftable(self) -> np.ndarray:
        """(128,) bool, which rows of the observation can be unloaded now.

        Where the physics is not restored after a pick, asking would change the container, and is a
        ValueError.
        """
        self._check_started()
        if not self.physics.exact:
            raise ValueError("after_pick lets lifts move other boxes; expected 'restore'")
        lifts = [self.physics.lift(item) if item >= 0 else 0.0 for item in self.visible.tolist()]
        return np.array(lifts) >= task.LIFT_THRESHOLD

    def render(self) -> np.ndarray | None:
        """(480, 640, 3) uint8 for ``render_mode="rgb_array"``, else None."""
        self._check_started()
        if self.render_mode is None:
            return None
        from unload.load.picture import snapshot  # here, because few look and Matplotlib is slow

        return snapshot(self.physics.load, self.physics.present, self.physics.positions())

    def close(self) -> None:
        if self._own:
            self.physics.close()
        super().close()

    def observed_positions(self) -> np.ndarray:
        """(n, 3) float64, where all items of the load are seen to be, in m."""
        self._check_started()
        positions = self.physics.positions()
        return positions + self._blur if self.physics.exact else positions

    def _look(self) -> None:
        """Update which items are visible, and the observation of them."""
        present = np.flatnonzero(self.physics.present)
        positions = self.observed_positions()[present]
        container = self.physics.load.container
        rows = observation.nearest(positions, container=container)
        self.visible = np.full(task.N_VISIBLE, -1)
        self.visible[: len(rows)] = present[rows]
        self._observation = self._features(positions[rows], container)

    def _info(self) -> dict:
        return {
            "action_mask": self.action_masks().astype(np.int8),
            "item_mask": (self.visible >= 0).astype(np.int8),
            "unloaded": np.int64(self._unloaded),
        }
