"""The environments for many containers at once, in arrays (Sec. III-A, Fig. 2).

``gymnasium.make_vec(id, num_envs)`` makes them. Each behaves, bit for bit, as Gymnasium's
``SyncVectorEnv`` of the single environments with autoreset in the same step: same seeds,
same actions, same observations, rewards, masks and infos. Each environment begins its next
episode when its own has ended.
"""

from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Sequence

import gymnasium
import numpy as np
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from unload import task
from unload.env import observation
from unload.env.container import check_stack
from unload.env.equalization import TIE_TOLERANCE, TIES
from unload.env.fast import containers
from unload.env.fast.ranking import nearest_first
from unload.env.highest_item import GRID, highest_places
from unload.env.observation import POSITION_NOISE, drift, scaled
from unload.load.boxes import Load, check_load
from unload.load.substacks import stack_load
from unload.physics.full import shared_table
from unload.physics.situation import Surroundings
from unload.support import checks, random_state


class PickingVectorEnv(gymnasium.vector.VectorEnv):
    """Base of environments in which each action picks one of 128 observed items.

    Args:
        num_envs: number of environments.
        equalize, ties, max_picks, position_noise: as for the single environment.
        render_mode: None; there are no pictures of many containers.

    Raises:
        TypeError, ValueError: an argument, a seed or actions are not as described.
        gymnasium.error.ResetNeeded: ``step`` or ``get_state`` before ``reset``.
        gymnasium.error.ClosedEnvironmentError: use after ``close``.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.SAME_STEP}

    def __init__(
        self,
        num_envs: int = task.NUM_ENVS,
        equalize: bool = False,
        ties: str = "noise",
        max_picks: int = task.MAX_PICKS,
        position_noise: float = POSITION_NOISE,
        render_mode: None = None,
    ) -> None:
        self.num_envs = checks.integer("num_envs", num_envs, 1)
        self.equalize = checks.boolean("equalize", equalize)
        checks.one_of("ties", ties, TIES)
        checks.one_of("render_mode", render_mode, (None,))
        self.ties = ties
        self.max_picks = checks.integer("max_picks", max_picks, 1)
        self.position_noise = checks.real("position_noise", position_noise, 0)
        shape = (task.N_VISIBLE, 3)
        self.single_observation_space = gymnasium.spaces.Box(-1, 1, shape, np.float32)
        self.single_action_space = gymnasium.spaces.Discrete(task.N_VISIBLE)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._features = (self.equalize, ties == "average", np.float32(TIE_TOLERANCE))
        self._rngs: list[np.random.Generator] = []
        self._starts: list[str] = []  # the generators' states before each episode's reset
        # Of each episode so far. An environment that waits for others counts up to 0.
        self._picks = np.zeros(self.num_envs, np.int64)
        # The last actions, (num_envs,) each: no episode is longer.
        self._actions: deque[np.ndarray] = deque(maxlen=self.max_picks)

    def reset(self, *, seed: int | Sequence[int | None] | None = None, options=None):
        """Start an episode in every environment. There are no options.

        Args:
            seed: environment i gets ``seed + i``, or ``seed[i]`` of a sequence; None lets
                the generators go on, or seeds them at random.
        """
        self._check_open()
        if options:
            raise ValueError(f"options is {options!r}; expected none")
        if seed is None:
            seeds = [None] * self.num_envs
        elif isinstance(seed, Sequence):
            seeds = [None if one is None else checks.integer("seed", one, 0) for one in seed]
            if len(seeds) != self.num_envs:
                raise ValueError(f"seed holds {len(seeds)} seeds; expected {self.num_envs}")
        else:
            seeds = range(checks.integer("seed", seed, 0), seed + self.num_envs)
        old = self._rngs or [None] * self.num_envs
        self._rngs = [
            rng if one is None and rng is not None else seeding.np_random(one)[0]
            for one, rng in zip(seeds, old)
        ]
        return self._restart()

    def step(self, actions: np.ndarray):
        """Pick row ``actions[i]``, (num_envs,) int, in environment i.

        Where an episode ends, the next one begins: the observation and infos are the
        reset's, and ``infos["final_obs"]`` and ``infos["final_info"]`` hold the last ones.
        """
        self._check_started()
        actions = checks.integer_array("actions", actions, (self.num_envs,))
        if actions.min() < 0 or actions.max() >= task.N_VISIBLE:
            raise ValueError(
                f"actions holds {actions.min()} to {actions.max()}; "
                f"expected 0 to {task.N_VISIBLE - 1}"
            )
        return self._advance(actions)

    def _advance(self, actions: np.ndarray):
        """``step`` by checked actions; where one is -1, the environment waits."""
        self._actions.append(actions)
        rewards = self._pick(actions)
        self._picks += 1
        terminations = self._emptied()
        truncations = self._picks == self.max_picks
        observations, infos = self._look(), self._infos() | self._pick_infos()
        ended = terminations | truncations
        if ended.any():
            observations, infos = self._begin_next(ended, observations, infos)
        else:
            infos = _flagged(infos, ~ended)
        return observations, rewards, terminations, truncations, infos

    def _begin_next(self, ended: np.ndarray, last: np.ndarray, last_infos: dict[str, np.ndarray]):
        """Begin the next episode where one has ended; what ``step`` shows and tells then.

        Args:
            ended: (num_envs,) bool.
            last, last_infos: what was seen and told after the pick in every environment.
        """
        self._begin(ended)
        infos = _flagged(self._infos(), np.ones(self.num_envs, bool))
        if not ended.all():  # a reset does not tell of a pick
            picks = {name: each for name, each in last_infos.items() if name not in infos}
            infos |= _flagged(_masked(picks, ~ended), ~ended)
        final = np.full(self.num_envs, None)
        for env in np.flatnonzero(ended):
            final[env] = last[env]
        infos |= {"final_obs": final, "_final_obs": ended}
        final_infos = _flagged(_masked(last_infos, ended), ended)
        infos |= {"final_info": final_infos, "_final_info": ended}
        return self._look(), infos

    def get_state(self) -> dict[str, np.ndarray]:
        """All that ``set_state`` needs to go on from here.

        Returns:
            ``rng``: (num_envs,) str, the generators' states before each episode's reset, and
            ``actions``: (picks, num_envs) int64, the picks made since, the latest in the last
            row. -1 stands for picks before the environment's episode began.
        """
        self._check_started()
        steps = int(self._picks.max())
        latest = list(self._actions)[len(self._actions) - steps :]
        actions = np.array(latest, np.int64).reshape(steps, self.num_envs)
        actions[np.arange(steps)[:, np.newaxis] < steps - self._picks] = -1
        return {"rng": np.array(self._starts), "actions": actions}

    def set_state(self, state: dict[str, np.ndarray]):
        """Go on from what ``get_state`` returned, here or in another environment.

        The picks are repeated; they may be those of several episodes. An environment whose
        first actions are -1 waits for the others meanwhile.

        Returns:
            Observations and infos after the last of them.

        Raises:
            TypeError, ValueError: ``state`` is something else.
        """
        self._check_open()
        checks.entries("state", state, ("rng", "actions"))
        texts = np.asarray(state["rng"])
        if texts.shape != (self.num_envs,):
            raise ValueError(f"state['rng'] has shape {texts.shape}; expected ({self.num_envs},)")
        for text in texts:
            random_state.check_text("state['rng']", text)
        actions = checks.integer_array("state['actions']", state["actions"], (None, self.num_envs))
        if actions.size and not (-1 <= actions.min() and actions.max() < task.N_VISIBLE):
            raise ValueError(
                f"state['actions'] holds {actions.min()} to {actions.max()}; "
                f"expected 0 to {task.N_VISIBLE - 1}, or -1"
            )
        if (actions[1:] < 0)[actions[:-1] >= 0].any():
            raise ValueError("state['actions'] holds -1 after a pick; expected -1 before all picks")
        self._rngs = [np.random.default_rng() for _ in range(self.num_envs)]
        for rng, text in zip(self._rngs, texts):
            random_state.set_text(text, rng)
        observations, infos = self._restart()
        self._picks -= (actions < 0).sum(axis=0)
        for row in actions:
            observations, _, _, _, infos = self._advance(row)
        return observations, infos

    def close_extras(self, **kwargs) -> None:
        """Nothing to free."""

    def _restart(self):
        """Begin an episode in every environment; what ``reset`` shows and tells."""
        everywhere = np.ones(self.num_envs, bool)
        self._starts = [""] * self.num_envs
        self._actions.clear()
        self._begin(everywhere)
        return self._look(), _flagged(self._infos(), everywhere)

    def _begin(self, where: np.ndarray) -> None:
        """Begin an episode in some environments, (num_envs,) bool."""
        envs = np.flatnonzero(where)
        for env in envs:
            self._starts[env] = random_state.to_text(self._rngs[env])
        self._picks[envs] = 0
        self._fill(envs)

    def _check_open(self) -> None:
        if self.closed:
            raise ClosedEnvironmentError("the environment is closed; make a new one")

    def _check_started(self) -> None:
        self._check_open()
        if not len(self._starts):
            raise ResetNeeded("the episodes are not started; call reset first")

    @abstractmethod
    def _fill(self, envs: np.ndarray) -> None:
        """Put fresh items into the environments of these numbers, (k,) int64."""

    @abstractmethod
    def _pick(self, actions: np.ndarray) -> np.ndarray:
        """Carry out checked actions where they are not -1; the rewards, (num_envs,) float64."""

    @abstractmethod
    def _emptied(self) -> np.ndarray:
        """Where the last item has been unloaded, (num_envs,) bool."""

    @abstractmethod
    def _look(self) -> np.ndarray:
        """A fresh array of what is seen, (num_envs, 128, 3) float32."""

    @abstractmethod
    def _infos(self) -> dict[str, np.ndarray]:
        """What ``reset`` and ``step`` tell, without Gymnasium's flags."""

    def _pick_infos(self) -> dict[str, np.ndarray]:
        """What only ``step`` tells."""
        return {}


def _flagged(infos: dict[str, np.ndarray], where: np.ndarray) -> dict[str, np.ndarray]:
    """Add Gymnasium's flags that say in which environments there are such infos."""
    return infos | {f"_{name}": where for name in infos}


def _masked(infos: dict[str, np.ndarray], where: np.ndarray) -> dict[str, np.ndarray]:
    """The infos of some environments, and 0 elsewhere."""
    infos = {name: values.copy() for name, values in infos.items()}
    for values in infos.values():
        values[~where] = 0
    return infos


class ContainerVectorEnv(PickingVectorEnv):
    """``unload/Container-v0`` with ``physics="table"``, for many containers.

    See ``ContainerEnv`` for the task and for the arguments not explained here.

    Args:
        num_envs: number of containers.
        physics: ``"table"``; there is no other one for arrays.
        stack: makes a ``Load`` from a ``numpy.random.Generator``.

    Attributes:
        visible: (num_envs, 128) int32, the item in each row of the observations, -1 in rows
            without.
    """

    def __init__(
        self,
        num_envs: int = task.NUM_ENVS,
        physics: str = "table",
        stack: Callable[[np.random.Generator], Load] = stack_load,
        **settings,
    ) -> None:
        super().__init__(num_envs, **settings)
        checks.one_of("physics", physics, ("table",))
        check_stack(stack)
        self.stack = stack
        self.table = shared_table()
        self._containers = containers.allocate(self.num_envs, 0, 0)

    @property
    def visible(self) -> np.ndarray:
        return self._containers.visible.copy()

    def action_masks(self) -> np.ndarray:
        """(num_envs, 128) bool, False for rows without a box or failed since the last success."""
        self._check_started()
        return self._containers.masks.astype(bool)

    def _fill(self, envs: np.ndarray) -> None:
        for env in envs:
            rng = self._rngs[env]
            load = self.stack(rng)
            check_load(load)
            self._put(env, load, drift(len(load), self.position_noise, rng))

    def _put(self, env: int, load: Load, blur: np.ndarray) -> None:
        """Fill one container."""
        starts, links = load.contacts
        self._make_room(len(load), len(links))
        state, count = self._containers, len(load)
        positions = load.positions + blur
        state.geometry[env, :count, :3] = load.positions
        state.geometry[env, :count, 3:] = load.sizes
        state.starts[env, :, : count + 1] = starts
        state.links[env, : len(links)] = links
        state.present[env, :count] = True
        state.present[env, count:] = False
        state.left[env] = count
        state.seen[env, :count] = scaled(positions)
        state.by_distance[env, :count] = observation.nearest(positions, count)
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
        for before, after in zip(old, self._containers):
            after[tuple(slice(length) for length in before.shape)] = before

    def _pick(self, actions: np.ndarray) -> np.ndarray:
        state, table = self._containers, self.table
        items, distances = containers.look_up(state, actions, table.digests, table.micrometres)
        if distances.min() == containers.UNKNOWN:
            for env in np.flatnonzero(distances == containers.UNKNOWN):
                distances[env] = self._lift(env, items[env])
        self._items, self._distances = items, distances
        return containers.pick(state, actions, distances, *self._features)

    def _lift(self, env: int, item: int) -> float:
        """Ask PyBullet for a lift that the table does not know, and let it remember."""
        present = self._containers.present[env]
        boxes = self._containers.geometry[env, : np.flatnonzero(present)[-1] + 1]
        labels = np.zeros(len(boxes), np.int64)
        load = Load(boxes[:, :3], boxes[:, 3:], labels, labels)
        return self.table.lift(Surroundings(load, present[: len(boxes)]).situation(item))

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

    def _pick_infos(self) -> dict[str, np.ndarray]:
        return {"item": self._items, "distance": self._distances}


class HighestItemVectorEnv(PickingVectorEnv):
    """``unload/HighestItem-v0``, many at once. See ``HighestItemEnv``."""

    def __init__(self, num_envs: int = task.NUM_ENVS, **settings) -> None:
        super().__init__(num_envs, **settings)
        self._observations = np.zeros(self.observation_space.shape, np.float32)
        self._highest = np.zeros((self.num_envs, task.N_VISIBLE), bool)

    def _fill(self, envs: np.ndarray) -> None:
        shape = len(envs), task.N_VISIBLE
        places, offsets = np.empty((*shape, 3)), np.empty((*shape, 3))
        for number, env in enumerate(envs):
            rng = self._rngs[env]
            places[number] = GRID[rng.integers(len(GRID), size=task.N_VISIBLE)]
            offsets[number] = drift(task.N_VISIBLE, self.position_noise, rng)
        positions = (places + offsets).reshape(-1, 3)
        observations, highest = np.empty((*shape, 3), np.float32), np.empty(shape, bool)
        nearest_first(
            observation.distance(positions).reshape(shape),
            scaled(positions).reshape(*shape, 3),
            highest_places(places),
            *self._features,
            observations,
            highest,
        )
        self._observations[envs], self._highest[envs] = observations, highest

    def _pick(self, actions: np.ndarray) -> np.ndarray:
        rewards = np.where(self._highest[np.arange(self.num_envs), actions], 1.0, -1.0)
        waiting = actions < 0
        rewards[waiting] = 0
        self._fill(np.flatnonzero(~waiting))
        return rewards

    def _emptied(self) -> np.ndarray:
        return np.zeros(self.num_envs, bool)  # there are always 128 items

    def _look(self) -> np.ndarray:
        return self._observations.copy()

    def _infos(self) -> dict[str, np.ndarray]:
        shape = (self.num_envs, task.N_VISIBLE)
        return {name: np.ones(shape, np.int8) for name in ("action_mask", "item_mask")}
