"""The environments for many containers at once, in arrays (Sec. III-A, Fig. 2)."""

from collections.abc import Callable
from typing import Literal

import numpy as np

from unload import task
from unload.env import observation
from unload.env.base import PickingVectorEnv, stacked
from unload.env.equalization import TIE_TOLERANCE, equalize
from unload.env.highest_item import GRID, highest_places
from unload.env.observation import drift, scaled
from unload.fast import containers
from unload.load.boxes import Load, check_stack
from unload.load.substacks import stack_load
from unload.physics.situation import Surroundings
from unload.physics.table import TablePhysics, shared_table
from unload.support import checks


class ContainerVectorEnv(PickingVectorEnv):
    """``unload/Container-v0`` with ``physics="table"``, for many containers.

    See ``ContainerEnv`` for the task and for the arguments not explained here.

    Args:
        physics: ``"table"``, or a ``TablePhysics`` of your own, which is left open. With
            ``gymnasium.make_vec(..., vectorization_mode="sync")`` any ``Physics`` will do.

    Attributes:
        table: the lifts that are known, filled by unknown ones; it may be replaced.
        visible: (num_envs, 128) int32, the item in each row of the observations, -1 in rows
            without.
    """

    options = ("load",)

    def __init__(
        self,
        num_envs: int = task.NUM_ENVS,
        physics: Literal["table"] | TablePhysics = "table",
        stack: Callable[[np.random.Generator], Load] = stack_load,
        **settings,
    ) -> None:
        super().__init__(num_envs, **settings)
        check_stack(stack)
        self._features = (self.equalize, self.ties == "average", np.float32(TIE_TOLERANCE))
        if isinstance(physics, TablePhysics):
            self._physics = physics
        else:
            checks.one_of("physics", physics, ("table", "a TablePhysics"))
            self._physics = TablePhysics(shared_table())
        self._own = self._physics is not physics
        self.stack, self.table = stack, self._physics.table
        self._containers = containers.allocate(self.num_envs, 0, 0)
        self._around: dict[int, Surroundings] = {}

    def close_extras(self, **kwargs) -> None:
        if self._own:
            self._physics.close()
        super().close_extras(**kwargs)

    @property
    def visible(self) -> np.ndarray:
        self._check_started()
        return self._containers.visible.copy()

    def action_masks(self) -> np.ndarray:
        """(num_envs, 128) bool, False for rows without a box or failed since the last success."""
        self._check_started()
        return self._containers.masks.astype(bool)

    def liftable(self) -> np.ndarray:
        """(num_envs, 128) bool, which rows of the observations can be unloaded now."""
        self._check_started()
        rows = (np.full(self.num_envs, row) for row in range(task.N_VISIBLE))
        distances = np.stack([self._look_up(actions)[1] for actions in rows], axis=1)
        return distances >= task.LIFT_THRESHOLD

    def _fill(
        self, envs: np.ndarray, rngs: list[np.random.Generator], load: Load | None = None
    ) -> None:
        for env, rng in zip(envs, rngs):
            chosen = stacked(self.stack, rng) if load is None else load
            self._put(env, chosen, drift(len(chosen), self.position_noise, rng))

    def _put(self, env: int, load: Load, blur: np.ndarray) -> None:
        """Fill one container."""
        if (other := load.masses[load.masses != task.MASS]).size:
            wanted = f"expected {task.MASS} kg each in arrays; physics='local' lifts others"
            raise ValueError(f"a load holds a box of {other[0]} kg; {wanted}")
        self._around.pop(env, None)
        starts, links = load.contacts
        self._make_room(len(load), len(links))
        state, count = self._containers, len(load)

        # Lifts follow where the boxes are put, observations where they are seen.
        positions = load.positions + blur
        state.geometry[env, :count, :3] = load.positions
        state.geometry[env, :count, 3:] = load.sizes
        state.starts[env, :, : count + 1] = starts
        state.links[env, : len(links)] = links
        state.present[env, :count] = True
        state.present[env, count:] = False
        state.left[env] = count
        state.sizes[env], state.tolerances[env] = load.container, load.contact_tolerance
        state.seen[env, :count] = scaled(positions, load.container)
        state.by_distance[env, :count] = observation.nearest(positions, count, load.container)
        containers.start(state, env, *self._features)

    def _make_room(self, items: int, links: int) -> None:
        """Let the arrays hold loads of so many items and contacts."""
        old = self._containers
        room = old.present.shape[1], old.links.shape[1]
        if items <= room[0] and links <= room[1]:
            return
        # A tenth more than needed, so that not every larger load moves all again.
        wanted = [max(have, need + need // 10) for have, need in zip(room, (items, links))]
        self._containers = containers.allocate(self.num_envs, *wanted)
        self._around.clear()  # which refer to the old arrays
        for before, after in zip(old, self._containers):
            after[tuple(slice(length) for length in before.shape)] = before

    def _pick(
        self, actions: np.ndarray, playing: np.ndarray
    ) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        items, distances = self._look_up(actions)
        rewards = containers.pick(self._containers, actions, distances, *self._features)
        return rewards, {"item": items, "distance": distances}

    def _look_up(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Each chosen item, (num_envs,) int64, and how far a lift moves it in m, float64."""
        items, distances = containers.look_up(self._containers, actions, *self.table.slots)
        unknown = np.flatnonzero(distances == containers.UNKNOWN)
        if unknown.size:
            self._physics.table = self.table  # it may have been replaced
            distances[unknown] = self._physics.simulate_all(
                [self._surroundings(int(env)).situation(int(items[env])) for env in unknown]
            )
        return items, distances

    def _surroundings(self, env: int) -> Surroundings:
        """The situations in a container, made when one is first needed."""
        if env not in self._around:
            # The load is built again, because to keep those of all containers makes resets slower.
            count = np.flatnonzero(self._containers.present[env])[-1] + 1
            boxes, labels = self._containers.geometry[env, :count], np.zeros(count, np.int64)
            load = Load(
                boxes[:, :3],
                boxes[:, 3:],
                labels,
                labels,
                container=self._containers.sizes[env],
                contact_tolerance=self._containers.tolerances[env],
            )
            self._around[env] = Surroundings(load, self._containers.present[env, :count])
        return self._around[env]

    def _emptied(self) -> np.ndarray:
        return self._containers.left == 0

    def _look(self) -> np.ndarray:
        return self._containers.observations.copy()

    def _infos(self) -> dict[str, np.ndarray]:
        return {
            "action_mask": self._containers.masks.copy(),
            "item_mask": (self._containers.visible >= 0).view(np.int8),
            "unloaded": self._containers.unloaded.copy(),
        }

    def _arrays(self) -> dict[str, np.ndarray]:
        return self._containers._asdict()

    def _hold(self, arrays: dict[str, np.ndarray]) -> None:
        self._containers = containers.Containers(**arrays)
        self._around.clear()


class HighestItemVectorEnv(PickingVectorEnv):
    """``unload/HighestItem-v0``, many at once. See ``HighestItemEnv``."""

    def __init__(self, num_envs: int = task.NUM_ENVS, **settings) -> None:
        super().__init__(num_envs, **settings)
        self._observations = np.zeros(self.observation_space.shape, np.float32)
        self._highest = np.zeros((self.num_envs, task.N_VISIBLE), bool)

    def _fill(self, envs: np.ndarray, rngs: list[np.random.Generator]) -> None:
        # The draws are those of the single environment, one generator after the other.
        shape = len(rngs), task.N_VISIBLE
        places, offsets = np.empty((*shape, 3)), np.empty((*shape, 3))
        for number, rng in enumerate(rngs):
            places[number] = GRID[rng.integers(len(GRID), size=task.N_VISIBLE)]
            offsets[number] = drift(task.N_VISIBLE, self.position_noise, rng)

        # The rest is done for all environments at once.
        positions = (places + offsets).reshape(-1, 3)
        order = observation.distance(positions).reshape(shape).argsort(axis=1, kind="stable")
        rows = order[:, :, np.newaxis]
        seen = np.take_along_axis(scaled(positions).reshape(*shape, 3), rows, axis=1)
        self._observations[envs] = equalize(seen, self.ties) if self.equalize else seen
        self._highest[envs] = np.take_along_axis(highest_places(places), order, axis=1)

    def _pick(
        self, actions: np.ndarray, playing: np.ndarray
    ) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        rewards = np.where(self._highest[np.arange(self.num_envs), actions], 1.0, -1.0)
        envs = np.flatnonzero(playing)
        self._fill(envs, [self._rngs[env] for env in envs])
        return rewards, {}

    def _emptied(self) -> np.ndarray:
        return np.zeros(self.num_envs, bool)  # there are always 128 items

    def _look(self) -> np.ndarray:
        return self._observations.copy()

    def _infos(self) -> dict[str, np.ndarray]:
        shape = (self.num_envs, task.N_VISIBLE)
        return {name: np.ones(shape, np.int8) for name in ("action_mask", "item_mask")}

    def _arrays(self) -> dict[str, np.ndarray]:
        return {"observations": self._observations, "highest": self._highest}

    def _hold(self, arrays: dict[str, np.ndarray]) -> None:
        self._observations, self._highest = arrays["observations"], arrays["highest"]
