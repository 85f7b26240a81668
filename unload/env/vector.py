"""Many containers in arrays (Sec. III-A, Fig. 2): what ``PickingVectorEnv.step`` asks of them."""

from collections.abc import Callable
from typing import Any

import numpy as np

from unload import task
from unload.env import observation
from unload.env.base import PickingVectorEnv
from unload.env.observation import drift, scale
from unload.fast import containers
from unload.load.boxes import Load, check_no_overhang, check_stack, check_supported
from unload.load.substacks import stack_load
from unload.physics.local import LocalPhysics
from unload.physics.situation import situation_in
from unload.physics.table import PhysicsName, make_physics


class ContainerVectorEnv(PickingVectorEnv):
    """``unload/Container-v0`` with ``physics="table"``, for many containers.

    See ``ContainerEnv`` for the task and for the arguments not explained here.

    Args:
        physics: ``"table"``, which is the fastest, and so the default here, where picks are made by
            the million; ``"places"``, ``"local"``, or a ``LocalPhysics`` of your own, whose
            ``simulate`` is called for each lift of a box that does not repeat a failed one; a
            ``TablePhysics`` is asked only what neither its table nor a rule answers.

    Attributes:
        physics: what lifts.
        visible: (num_envs, 128) int32, the item in each row of the observations, -1 in rows
            without.
    """

    options = ("load",)

    def __init__(
        self,
        num_envs: int = task.NUM_ENVS,
        physics: PhysicsName | LocalPhysics = "table",
        stack: Callable[[np.random.Generator], Load] = stack_load,
        **settings,
    ) -> None:
        super().__init__(num_envs, **settings)
        check_stack(stack)
        self._how_observed = self.equalize, self.ties == "average"
        self.stack = stack
        self.physics: Any = make_physics(physics)
        # What is in its arrays, ``fast.containers.Containers`` says.
        self._containers = containers.allocate(self.num_envs, 0, 0)
        # Of each container: its load, and where all items of it are seen to be, (n, 3) in m. No
        # step of this class needs them, so that no checkpoint keeps them; a single environment
        # shows them.
        self._loads: list[Any] = [None] * self.num_envs
        self._seen_at: list[Any] = [None] * self.num_envs

    def close_extras(self, **kwargs) -> None:
        self.physics.close()
        super().close_extras(**kwargs)

    @property
    def visible(self) -> np.ndarray:
        self._check_started()
        return self._containers.visible.copy()

    def _present(self, env: int) -> np.ndarray:
        """(n,) bool, which items of a container's load have not been unloaded."""
        return self._containers.present[env, : len(self._loads[env])].copy()

    def liftable(self) -> np.ndarray:
        """(num_envs, 128) bool, which rows of the observations can be unloaded now."""
        self._check_started()
        rows = (np.full(self.num_envs, row) for row in range(task.N_VISIBLE))
        distances = np.stack([self._lift(actions)[1] for actions in rows], axis=1)
        return distances >= task.LIFT_THRESHOLD

    def _fill(
        self, envs: np.ndarray, rngs: list[np.random.Generator], load: Load | None = None
    ) -> None:
        for env, rng in zip(envs, rngs):
            chosen = self.stack(rng) if load is None else load
            # The paper's loads stand and have no overhangs, as they are made. Lifts that follow
            # contacts alone would pull a box through one that hangs over it.
            if load is not None or self.stack is not stack_load:
                self._check(chosen, "load" if load is not None else "what stack returned")
            starts, links = chosen.contacts
            self._make_room(len(chosen), len(links))
            state, count = self._containers, len(chosen)

            # Lifts follow where the boxes are put, observations where they are seen.
            state.geometry[env, :count, :3] = chosen.positions
            state.geometry[env, :count, 3:] = chosen.sizes
            state.starts[env, :, : count + 1] = starts
            state.links[env, : len(links)] = links
            state.present[env, :count] = True
            state.present[env, count:] = False
            state.left[env], state.unloaded[env] = count, 0
            state.widths[env] = chosen.container[1]
            noise = drift(count, self.position_noise, rng)
            self._show(env, np.arange(count), chosen.positions + noise, chosen)

    def _check(self, load: Load, name: str) -> None:
        check_supported(load, name)
        check_no_overhang(load)

    def _show(self, env: int, items: np.ndarray, positions: np.ndarray, load: Load) -> None:
        """Show the nearest of the items that are left.

        Args:
            env: which container.
            items: (k,) int64, those that are left.
            positions: (n, 3) float64, where all items of the load are seen to be, in m.
            load: of the container.
        """
        state = self._containers
        self._loads[env], self._seen_at[env] = load, positions
        order = observation.nearest(positions[items], len(items), load.container)
        state.by_distance[env, : len(items)] = items[order]
        state.seen[env, : len(load)] = scale(positions, load.container)
        containers.show_nearest(state, env, *self._how_observed)

    def _make_room(self, items: int, links: int) -> None:
        """Let the arrays hold loads of so many items and contacts."""
        old = self._containers
        room = old.present.shape[1], old.links.shape[1]
        if items <= room[0] and links <= room[1]:
            return
        # A tenth more than needed, so that not every larger load moves all again.
        wanted = [max(have, need + need // 10) for have, need in zip(room, (items, links))]
        self._containers = containers.allocate(self.num_envs, *wanted)
        for before, after in zip(old, self._containers):
            after[tuple(slice(length) for length in before.shape)] = before

    def _pick(
        self, actions: np.ndarray, playing: np.ndarray
    ) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        # ``playing`` is not needed: ``step`` drops the rewards of the others, and refills them.
        items, distances = self._lift(actions)
        rewards = containers.unload_lifted(
            self._containers, actions, distances, *self._how_observed
        )
        return rewards, {"item": items, "distance": distances}

    def _lift(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Each chosen item, (num_envs,) int64, and how far a lift moves it in m, float64.

        What is not known, ``physics`` simulates; a ``TablePhysics`` adds it to its table.
        """
        state = self._containers
        known = self.physics.known or containers.NOTHING_KNOWN
        items, distances = containers.look_up(state, actions, *known)
        unknown = np.flatnonzero(distances == containers.UNKNOWN)
        if unknown.size:
            arrays = (state.starts, state.links, state.present, state.geometry, state.widths, items)
            situations = [situation_in(*(array[env] for array in arrays)) for env in unknown]
            distances[unknown] = [self.physics.simulate(each) for each in situations]
        return items, distances

    def _emptied(self) -> np.ndarray:
        return self._containers.left == 0

    def state_dict(self) -> dict[str, Any]:
        """See ``PickingVectorEnv``; a physics with such methods is asked for its own state."""
        own = {"containers": self._containers._asdict()}
        if hasattr(self.physics, "state_dict"):
            own["physics"] = self.physics.state_dict()
        return super().state_dict() | own

    def load_state_dict(self, state: dict[str, Any]) -> None:
        super().load_state_dict(state)
        self._containers = containers.Containers(**state["containers"])
        if "physics" in state:
            self.physics.load_state_dict(state["physics"])

    def _copy_observations(self) -> np.ndarray:
        return self._containers.observations.copy()

    def _infos(self) -> dict[str, np.ndarray]:
        return {
            "action_mask": self._containers.masks.copy(),
            "item_mask": (self._containers.visible >= 0).view(np.int8),
            "unloaded": self._containers.unloaded.copy(),
        }
