"""What experiments change in a ``Training``, see ``unload.train``.

Each change is made before the first pick, and those of long runs depend on the pick alone, so that
a resumed run stays the same.

Observations are (batch, items, 3), x along the depth, y across the container, z upward. A change
of them is a function ``(observations, rng) -> observations``; it may write into what it is given.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache, partial

import numpy as np

from unload import task
from unload.agent.evaluation import Policy
from unload.agent.replay import ReplayBuffer
from unload.agent.training import Training
from unload.env.container import ContainerEnv
from unload.env.equalization import equalize
from unload.load.boxes import Load

Change = Callable[[np.ndarray, np.random.Generator], np.ndarray]
DEEPEST = task.MAX_PICKS - 25  # boxes: an episode of 25 picks ends where one of 500 would


def height_reward(run: Training, share: float) -> None:
    """Make a failed pick the less bad, the higher its item (Sec. V-A).

    Args:
        run: that learns.
        share: h, in [0, 1]. A failed pick is learned from as -1 + h (z + 1) / 2, z as observed;
            the learning curve keeps the rewards of the environment.
    """

    def reward(picks: dict[str, np.ndarray], distances: np.ndarray) -> np.ndarray:
        rewards, rows = picks["rewards"], np.arange(len(picks["actions"]))
        heights = (picks["observations"][rows, picks["actions"], 2] + 1) / 2  # in [0, 1]
        return np.where(rewards < 0, rewards + share * heights, rewards)

    run.reward = reward


def mirror(
    observations: np.ndarray, rng: np.random.Generator, axes: tuple[int, ...] = (0, 1)
) -> np.ndarray:
    """Give x and y of each observation random signs: a pick and its mirror images are alike."""
    signs = rng.choice(np.array([-1, 1], np.float32), (len(observations), 1, len(axes)))
    observations[..., axes] *= signs
    return observations


def shuffle_places(observations: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Permute the places (x, y) of each observation among its items; heights stay.

    No preference for a place can be learned from it. In loads with fewer items than are visible,
    the padded rows take part.
    """
    order = rng.random(observations.shape[:2]).argsort(axis=1)
    rows = np.arange(len(order))[:, np.newaxis]
    observations[..., :2] = observations[rows, order, :2]
    return observations


def store(run: Training, change: Change) -> None:
    """Change each observation as it is stored in the replay memory; choices see it as it was."""
    add = run.replay.add

    def add_changed(observations: np.ndarray, **rest: np.ndarray) -> None:
        rng = np.random.default_rng((run.config.seed, run.replay.total))
        add(observations=change(observations.copy(), rng), **rest)

    run.replay.add = add_changed


def see(run: Training, change: Callable[[np.ndarray], np.ndarray]) -> None:
    """Change what is seen, in choosing and in learning alike."""
    choose, add = run.agent.choose, run.replay.add
    run.agent.choose = lambda observations, *rest: choose(change(observations), *rest)
    run.replay.add = lambda observations, **rest: add(observations=change(observations), **rest)


def untilted(run: Training, axes: tuple[int, ...] = (0, 1)) -> None:
    """Choose by what is seen with random signs; the replay memory holds it as it was.

    Whatever side the network prefers, it prefers each side equally often, and digs out none. The
    signs are drawn in the order of the choices, so that a resumed run would draw others: it is for
    runs that are trained in one piece, such as the laboratory's.
    """
    choose, rng = run.agent.choose, np.random.default_rng(run.config.seed)
    run.agent.choose = lambda observations, *rest: choose(
        mirror(observations.copy(), rng, axes), *rest
    )


def without(observations: np.ndarray, axes: tuple[int, ...] = (0, 1)) -> np.ndarray:
    """Observations with some coordinates set to 0."""
    observations = observations.copy()
    observations[..., axes] = 0
    return observations


def ranked(observations: np.ndarray, averaged: tuple[int, ...]) -> np.ndarray:
    """Ranks of positions: ties share their mean rank in some axes, noise breaks them in others."""
    seen = equalize(observations, "noise")
    seen[..., averaged] = equalize(observations[..., averaged], "average")
    return seen


def repeated(replay: ReplayBuffer, picks: dict[str, np.ndarray], rows: np.ndarray) -> dict:
    """Some picks of a step, repeated so that as many are stored as otherwise.

    Args:
        replay: where they will be stored.
        picks: of the step.
        rows: (k,) int64, which of them; where there are none, what was stored last is repeated.
    """
    count = len(picks["rewards"])
    if len(rows):
        rows = np.resize(rows, count)
    else:
        picks, rows = replay.arrays, np.arange(replay.total - count, replay.total)
    return {name: values.take(rows, axis=0, mode="wrap") for name, values in picks.items()}


def successes_only(run: Training, start: int) -> None:
    """Store no failed pick from ``start`` picks on.

    In its place a successful one of the same step is stored twice, so that the memory reaches as
    far back as otherwise; where all of a step failed, what was stored last is stored again.
    """
    replay, add = run.replay, run.replay.add

    def add_successes(**picks: np.ndarray) -> None:
        won, count = np.flatnonzero(picks["rewards"] > 0), len(picks["rewards"])
        if replay.total >= start and len(won) < count and (len(won) or replay.total):
            picks = repeated(replay, picks, won)
        add(**picks)

    run.replay.add = add_successes


def best_actions(
    observations: np.ndarray, allowed: np.ndarray, preference: float = 0.0
) -> np.ndarray:
    """The choice of a policy that prefers a side: the highest z + ``preference`` · y."""
    score = observations[..., 2] + preference * observations[..., 1]
    return np.where(allowed, score, -np.inf).argmax(axis=1)


def taught(run: Training, preference: float) -> None:
    """Let the policy of ``best_actions`` choose."""
    run.agent.learner.best_actions = partial(best_actions, preference=preference)


def left(policy: Policy, picks: int, seed: int) -> Load:
    """What a policy leaves of one of the paper's loads after some picks, with the mask."""
    env, rng = ContainerEnv(physics="table", max_picks=picks + 1), np.random.default_rng(seed)
    observation, info = env.reset(seed=seed)
    for _ in range(picks):
        action = policy(observation[None], info["action_mask"][None], rng)[0]
        observation, *_, info = env.step(int(action))
    load, present = env.load, env.present
    return Load(
        *(each[present] for each in (load.positions, load.sizes, load.packages, load.walls))
    )


@cache
def dug_loads(preference: float) -> list[Load]:
    """128 loads of which the policy of ``best_actions`` has unloaded up to 475 boxes, on ranks."""

    def policy(observations: np.ndarray, masks: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        return best_actions(equalize(observations), masks.astype(bool), preference)

    depths = np.random.default_rng(0).integers(DEEPEST + 1, size=128)
    return [left(policy, int(depth), seed) for seed, depth in enumerate(depths)]


def dug(run: Training, preference: float) -> None:
    """From the second episode on, fill the containers with ``dug_loads``."""
    loads = dug_loads(preference)
    run.rollout.envs.unwrapped.stack = lambda rng: loads[rng.integers(len(loads))]


def perfect_start(run: Training) -> None:
    """Start from the weights of a run with shuffled places."""
    teacher = Training(replace(run.config, epsilon_init=1.0))
    shuffled(teacher)
    while not teacher.rollout.finished:
        teacher.step()
    teacher.rollout.close()
    run.agent.network.load_state_dict(teacher.agent.network.state_dict())


def several(run: Training, makes: Iterable[Callable[[Training], None] | None]) -> None:
    """Make some changes, one after the other; None is no change."""
    for make in makes:
        if make is not None:
            make(run)


mirrored = partial(store, change=mirror)
shuffled = partial(store, change=shuffle_places)
