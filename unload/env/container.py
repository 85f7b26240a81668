"""The container as a Gymnasium environment (Sec. III-A to III-D).

All is done by a ``ContainerVectorEnv`` of one container, or by a ``FullContainer``, which is one
whose boxes are all simulated. ``ContainerEnv`` shows its first row.
"""

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from gymnasium.vector import AutoresetMode

from unload import task
from unload.env.base import PickingEnv
from unload.env.full import FullContainer
from unload.env.observation import POSITION_NOISE
from unload.env.vector import ContainerVectorEnv
from unload.load.boxes import Load
from unload.load.substacks import stack_load
from unload.physics.full import FullPhysics
from unload.physics.local import LocalPhysics
from unload.physics.table import PhysicsName


class ContainerEnv(PickingEnv):
    """Unload a container by choosing, at each step, the item to pick.

    ## Description
    A container of 7.0 × 2.5 × 2.5 m holds 800–1000 boxes, stacked in walls. At each step
    the agent chooses one of the 128 boxes nearest to the entrance. It is pulled upwards
    with 20 N for 0.3 s; if it moved at least 0.2 m it is unloaded, else the container
    stays as it was (``FullPhysics("keep")`` excepted). With ``max_picks`` large enough, it is
    unloaded to the last box.

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
    A new random load from ``stack``, each position with noise, drawn once, as large as the
    drift of a full simulation (0.5 mm, and 1 mm down).

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
        physics: what is simulated at a lift:

            - ``"local"``: the situation of the chosen box. It is the default here, because each
              distance is the engine's own then;
            - ``"table"``: ``"local"``, remembered. It answers without a simulation if nothing rests
              on the chosen box (it moves by 0.463053 m), if three boxes or more do, and, in loads
              that it has not met, if a rule says that one or two hold it down (0 m);
            - ``"places"``: nothing. Whatever has a box on it is held down, which errs where
              PyBullet tips it off: in notebook 22 for 0 to 1 % of such boxes;
            - ``"full"``: every box, which takes seconds a pick.

            Or a ``LocalPhysics`` of your own, or a ``FullPhysics``, whose container is filled.
        equalize: give equalized observations (Alg. 1).
        ties: see ``unload.equalize``.
        max_picks: greatest length of an episode.
        position_noise: standard deviation of that noise in m, at most 10; with 0 the boxes are not
            lowered by 1 mm either. Boxes of ``FullPhysics("keep")`` have no such noise, because
            they drift: they are seen where they are.
        stack: makes a ``Load``, of any number of items and in a container of any size, from a
            ``numpy.random.Generator``. Each box stands on the floor or, within the load's
            ``contact_tolerance``, on another one: across a wider gap it would not hold it down.
            Boxes that hang over others on which they do not rest need ``"full"`` physics.
        render_mode: ``"rgb_array"`` for pictures, or None.

    Attributes:
        load: the load of this episode.
        present: (n,) bool, which of its items have not been unloaded.
        visible: (128,) int64, the item in each row of the observation, -1 in rows without.
        physics: what lifts.

    Raises:
        TypeError, ValueError: an argument, an action or a load is not as described.
        gymnasium.error.ResetNeeded: ``step`` or ``render`` before ``reset``, ``step`` after
            the end of an episode, or any of them after an error in the middle of a call.
        gymnasium.error.ClosedEnvironmentError: use after ``close``.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 4}
    _envs: ContainerVectorEnv

    def __init__(
        self,
        physics: Literal["full"] | PhysicsName | LocalPhysics | FullPhysics = "local",
        equalize: bool = False,
        ties: str = "noise",
        max_picks: int = task.MAX_PICKS,
        position_noise: float = POSITION_NOISE,
        stack: Callable[[np.random.Generator], Load] = stack_load,
        render_mode: str | None = None,
    ) -> None:
        settings: dict[str, Any] = {"equalize": equalize, "ties": ties, "max_picks": max_picks}
        settings |= {"position_noise": position_noise, "stack": stack}
        settings |= {"autoreset_mode": AutoresetMode.DISABLED}
        envs: ContainerVectorEnv
        if isinstance(physics, FullPhysics) or physics == "full":
            envs = FullContainer(FullPhysics() if isinstance(physics, str) else physics, settings)
        else:
            envs = ContainerVectorEnv(1, physics, **settings)
        super().__init__(envs, render_mode)

    @property
    def load(self) -> Load:
        self._check_started()
        return self._envs._loads[0]

    @property
    def present(self) -> np.ndarray:
        self._check_started()
        return self._envs._present(0)

    @property
    def visible(self) -> np.ndarray:
        return self._envs.visible[0].astype(np.int64)

    @property
    def physics(self) -> LocalPhysics | FullPhysics:
        return self._envs.physics

    def liftable(self) -> np.ndarray:
        """(128,) bool, which rows of the observation can be unloaded now.

        Where the physics is not restored after a pick, asking would change the container, and is a
        ValueError.
        """
        return self._envs.liftable()[0]

    def observed_positions(self) -> np.ndarray:
        """(n, 3) float64, where all items of the load are seen to be, in m."""
        self._check_started()
        return self._envs._seen_at[0].copy()

    def render(self) -> np.ndarray | None:
        """(480, 640, 3) uint8 for ``render_mode="rgb_array"``, else None."""
        self._check_started()
        if self.render_mode is None:
            return None
        from unload.drawing.picture import snapshot  # here, because few look and Matplotlib is slow

        physics, positions = self.physics, self.load.positions
        if isinstance(physics, FullPhysics):  # in which boxes move
            positions = physics.positions()
        return snapshot(self.load, self.present, positions)
