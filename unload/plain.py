"""The system on one page: the task of the paper, and masked DQN, which learns it.

Read this first. It is written to be understood, and looks at all boxes at each pick. ``env``,
``fast`` and ``agent`` do the same faster. The tests check that they give the same bits as this
page; training does with ``fused_update=False``, because the fused update rounds differently.
``python -m unload.plain`` trains on positions, in half a minute.
"""

from copy import deepcopy

import gymnasium
import numpy as np
import torch
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from torch.nn.functional import smooth_l1_loss

from unload import task
from unload.env import observation
from unload.env.equalization import equalize
from unload.env.highest_item import GRID
from unload.load.boxes import ABOVE, BELOW, BESIDE, CONTACT_TOLERANCE, Load
from unload.load.substacks import stack_load
from unload.network.peq import PEQNetwork
from unload.physics.situation import RESOLUTION, Situation
from unload.physics.table import TablePhysics, shared_table


# A lift (Sec. III-C): of all boxes that touch, a few decide whether another one can be lifted.
def on_top(load: Load, present: np.ndarray, item: int) -> list[int]:
    """Return the present boxes that rest on ``item``, directly or over others, in index order."""
    resting, frontier = set(), [item]
    while frontier:
        for box in load.contacts.of(ABOVE, frontier.pop()).tolist():
            if present[box] and box not in resting:
                resting.add(box)
                frontier.append(box)
    return sorted(resting)


def situation(load: Load, present: np.ndarray, item: int) -> Situation:
    """Return the situation of ``item``: the boxes that decide its lift, relative to it."""
    # It moves with all that rests on it; these boxes may rub against whatever they touch.
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

    # In whole micrometres equal situations are equal in bits, so that each is simulated once.
    return Situation(
        boxes=np.rint(boxes / RESOLUTION).astype(np.int32),
        dynamic=len(dynamic),
        floor=round(-centre[2] / RESOLUTION) if on_floor else None,
        sides=tuple(round(side / RESOLUTION) for side in sides),
    )


# The task (Sec. III-A to III-F) and a simpler one (Sec. IV-A), as environments of Gymnasium.
class Task(gymnasium.Env):
    """Base of both tasks: settings, spaces, and the observation of the nearest boxes."""

    def __init__(
        self, equalize=False, ties="noise", max_picks=task.MAX_PICKS,
        position_noise=observation.POSITION_NOISE, stack=stack_load,
    ):  # fmt: skip
        self.equalize, self.ties, self.max_picks = equalize, ties, max_picks
        self.position_noise, self.stack = position_noise, stack
        self.observation_space = gymnasium.spaces.Box(-1, 1, (task.N_VISIBLE, 3), np.float32)
        self.action_space = gymnasium.spaces.Discrete(task.N_VISIBLE)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.picks = 0
        self.fill(**options or {})
        return self.observe(), self.info()

    def features(self, positions: np.ndarray, container: np.ndarray) -> np.ndarray:
        """Scale the positions of boxes, nearest first (Sec. III-B), or equalize them (Alg. 1)."""
        seen = np.full((task.N_VISIBLE, 3), task.PADDING, np.float32)  # of the last boxes: padding
        seen[: len(positions)] = observation.scale(positions, container)
        present = np.arange(task.N_VISIBLE) < len(positions)
        return equalize(seen, self.ties, present=present) if self.equalize else seen


class Container(Task):
    """``unload/Container-v0``: empty a container; each pick is one of the 128 nearest boxes."""

    def fill(self, load: Load | None = None) -> None:
        """Stack a load at random (Sec. III-A), seen where the simulator lets boxes drift."""
        self.load = load or self.stack(self.np_random)
        drift = observation.drift(len(self.load), self.position_noise, self.np_random)
        self.positions, self.physics = self.load.positions + drift, TablePhysics(shared_table())
        self.present, self.failed = np.ones(len(self.load), bool), np.zeros(len(self.load), bool)

    def observe(self) -> np.ndarray:
        """Note which boxes are visible, the nearest to the entrance; return what is seen."""
        left = np.flatnonzero(self.present)
        rows = observation.nearest(self.positions[left], container=self.load.container)
        self.visible = np.full(task.N_VISIBLE, -1)
        self.visible[: len(rows)] = left[rows]
        return self.features(self.positions[left[rows]], self.load.container)

    def lift(self, item: int) -> float:
        """Return how far a pull of 20 N for 0.3 s moves a box, in m; 0 if the row holds no box."""
        here = self.load, self.present, item
        return self.physics.simulate(situation(*here)) if item >= 0 else 0.0

    def step(self, action: int):
        self.picks += 1
        item = int(self.visible[action])
        distance = self.lift(item)

        # A box that moved far enough is gone; a failure changes nothing but the mask (Sec. III-G).
        success = distance >= task.LIFT_THRESHOLD
        if success:
            self.present[item] = False
            self.failed[:] = False
        elif item >= 0:
            self.failed[item] = True
        seen, terminated = self.observe(), not self.present.any()
        info = self.info() | {"item": np.int64(item), "distance": np.float64(distance)}
        return seen, 1.0 if success else -1.0, terminated, self.picks == self.max_picks, info

    def info(self) -> dict:
        held = self.visible >= 0
        untried = held.copy()
        untried[held] = ~self.failed[self.visible[held]]
        return {
            "action_mask": untried.astype(np.int8),
            "item_mask": held.astype(np.int8),
            "unloaded": np.int64((~self.present).sum()),
        }


class HighestItem(Task):
    """``unload/HighestItem-v0``: pick the highest of boxes at random places, without physics."""

    def fill(self) -> None:
        """Draw from ``GRID``, all places that a box of a load can take (Fig. 3)."""
        self.places = GRID[self.np_random.integers(len(GRID), size=task.N_VISIBLE)]
        self.drift = observation.drift(task.N_VISIBLE, self.position_noise, self.np_random)

    def observe(self) -> np.ndarray:
        rows = observation.nearest(self.places + self.drift)
        self.highest = self.places[rows, 2] > self.places[:, 2].max() - 1e-6
        return self.features((self.places + self.drift)[rows], task.CONTAINER)

    def step(self, action: int):
        self.picks += 1
        reward = 1.0 if self.highest[action] else -1.0
        self.fill()
        return self.observe(), reward, False, self.picks == self.max_picks, self.info()

    def info(self) -> dict:
        return {name: np.ones(task.N_VISIBLE, np.int8) for name in ("action_mask", "item_mask")}


# Masked DQN (Sec. II-B and III-G): three functions and a loop. Of E environments, observations are
# (E, 128, 3) float32, masks (E, 128) bool or int8, and actions (E,) int64.
def choose(network, observations, allowed, epsilon, rng):
    """Choose ε-greedily: by random scores or the network's, and never what the mask excludes."""
    scores = np.empty(allowed.shape)  # (E, 128)
    explore = rng.random(len(allowed)) < epsilon  # (E,)
    scores[explore] = rng.random(scores[explore].shape)
    with torch.no_grad():
        scores[~explore] = network(torch.from_numpy(observations[~explore]))
    return np.where(allowed, scores, -np.inf).argmax(axis=1)


def update(network, target, optimizer, picks, gamma):
    """Bring the values of remembered picks nearer to their targets; return the loss."""
    columns = (torch.from_numpy(np.array(column)) for column in zip(*picks))
    before, chosen, reward, after, allowed_after, terminated = columns  # (batch, ...) each
    with torch.no_grad():
        best = target(after).masked_fill(~allowed_after, -torch.inf).amax(dim=1)
    goal = reward + gamma * best.masked_fill(terminated, 0)  # (batch,); no pick follows the last
    values = network(before).gather(1, chosen[:, None])[:, 0]  # (batch, 128) -> (batch,)
    loss = smooth_l1_loss(values, goal)  # ()
    optimizer.zero_grad()
    loss.backward()
    optimizer.step()
    return loss.item()


def pick(choose, envs, network, seen, epsilon, mask, rng):
    """Pick once in each environment; return what is remembered of each, and what is seen next.

    ``choose`` is the function above, or one of yours in its place.
    """
    observations, infos = seen  # (E, 128, 3)
    allowed = infos["action_mask" if mask else "item_mask"].astype(bool)  # (E, 128)
    actions = choose(network, observations, allowed, epsilon, rng)  # (E,)
    following, rewards, terminated, _, infos = envs.step(actions)  # (E, 128, 3), (E,), (E,)

    # Where an episode has ended, Gymnasium has begun the next one already. What was seen last in
    # the old one stands in ``final_obs`` and ``final_info``, and belongs to the pick.
    after = following.copy()  # (E, 128, 3)
    allowed_after = infos["action_mask"].astype(bool)  # (E, 128)
    for env in np.flatnonzero(infos.get("_final_obs", [])):
        after[env] = infos["final_obs"][env]
        allowed_after[env] = infos["final_info"]["action_mask"][env]
    rewards = rewards.astype(np.float32)
    picks = list(zip(observations, actions, rewards, after, allowed_after, terminated))
    return picks, (following, infos)


def masked_dqn(envs, network, steps, seeds, gamma=0.0, mask=True, batch_size=64, size=2**20):
    """Train the network in place; return the loss of each update and each step's mean reward."""
    rng, target = np.random.default_rng(seeds[1]), deepcopy(network)
    optimizer = torch.optim.Adam(network.parameters(), lr=1e-3)
    replay, losses, means = {}, [], []  # replay: the last `size` picks by their slots
    seen = envs.reset(seed=seeds[0])
    for step in range(steps):
        # A batch is drawn before the step's picks and learned from after them: so ``Training.step``
        # can compute an update while the environments step, and the order of draws is the same.
        learns = len(replay) >= batch_size
        slots = rng.integers(len(replay), size=batch_size) if learns else []
        epsilon = max(0, 1 - step / (steps / 2))  # 0 from half of the run on (Sec. IV-B)
        picks, seen = pick(choose, envs, network, seen, epsilon, mask, rng)
        if learns:
            batch = [replay[slot] for slot in slots]
            losses.append(update(network, target, optimizer, batch, gamma))
        replay |= {(step * len(picks) + env) % size: each for env, each in enumerate(picks)}
        if (step + 1) % 150 == 0:  # in between it stands still, so that values chase a fixed goal
            target.load_state_dict(network.state_dict())
        means.append(np.mean([reward for _, _, reward, *_ in picks]))
    return np.array(losses), np.array(means)


if __name__ == "__main__":
    torch.set_num_threads(1)  # small tensors: a second thread only costs time
    network = PEQNetwork(32, torch.Generator().manual_seed(0))
    envs = SyncVectorEnv([Container] * task.NUM_ENVS, autoreset_mode=AutoresetMode.SAME_STEP)
    _, means = masked_dqn(envs, network, steps=400, seeds=(0, 0))
    print(f"MSR of the last 50 steps: {(means[-50:].mean() + 1) / 2:.1%}")  # Sec. IV-A
