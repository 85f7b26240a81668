"""How well a policy picks."""

import sys
from collections.abc import Callable
from contextlib import closing
from functools import partial
from typing import Any, Literal

import numpy as np
import pandas as pd
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv

from unload import task
from unload.agent.policies import Policy, choosable
from unload.env.container import ContainerEnv
from unload.env.observation import POSITION_NOISE
from unload.env.vector import ContainerVectorEnv
from unload.load.boxes import Load
from unload.load.substacks import stack_load
from unload.physics.full import FullPhysics
from unload.physics.local import LocalPhysics
from unload.physics.table import PhysicsName
from unload.support import checks

MOST_EPISODES = 10**6
# Failed picks in a row after which an episode without a limit is given up.
GIVE_UP = 10 * task.N_VISIBLE


def success_rate(rewards: np.ndarray) -> float:
    """Mean success rate MSR = (mean reward + 1) / 2 (Sec. IV-A).

    Args:
        rewards: any shape, not empty, each +1 or -1.
    """
    rewards = checks.finite_array("rewards", rewards, None)
    if rewards.size == 0:
        raise ValueError("rewards is empty; expected at least one reward")
    if not (np.abs(rewards) == 1).all():
        wrong = rewards[np.abs(rewards) != 1].flat[0]
        raise ValueError(f"rewards holds {wrong}; expected only +1 and -1")
    return (float(rewards.mean()) + 1) / 2


def evaluate(
    policy: Policy,
    episodes: int = 20,
    seed: int = 0,
    physics: Literal["full"] | PhysicsName | LocalPhysics | FullPhysics = "table",
    mask: bool = True,
    max_picks: int | None = task.MAX_PICKS,
    equalize: bool = False,
    ties: str = "noise",
    position_noise: float = POSITION_NOISE,
    stack: Callable[[np.random.Generator], Load] = stack_load,
) -> pd.DataFrame:
    """Let a policy unload fresh containers.

    A pick counts as deadlocked if its item has failed before since the last success: the container
    has not changed, so it fails again (Sec. III-G), unless a ``FullPhysics("keep")`` moves boxes.

    Args:
        policy: see ``unload.policies``.
        episodes: number of containers.
        seed: of the loads and of the policy's random numbers. Episode i is the same whatever their
            number, the physics, and how many are played at once: a policy that draws is asked
            about one episode at a time, each with a generator of its own.
        physics: see ``ContainerEnv``. ``"table"`` plays 64 episodes side by side, the others
            one after the other.
        mask: whether the policy's masks exclude items that failed since the last success.
            Rows without an item are always excluded.
        max_picks: most picks per episode; fewer if the container is empty before, or if the
            mask excludes all items. With None it is unloaded completely, unless 1280 picks in a
            row fail.
        equalize, ties, position_noise, stack: of ``ContainerEnv``.

    Returns:
        One row per episode: ``success_rate``, ``unloaded`` (items), ``deadlocked``
        (share of picks) and ``longest_deadlock`` (deadlocked picks in a row); with
        ``max_picks=None`` also ``picks`` (int) and ``emptied`` (bool, False if given up).

    Raises:
        TypeError, ValueError: an argument is not as described, or ``policy`` returns
            something other than one row of the observation.
    """
    episodes = checks.integer("episodes", episodes, 1, MOST_EPISODES)
    seed = checks.integer("seed", seed, 0)
    mask = checks.boolean("mask", mask)
    if max_picks is not None:
        max_picks = checks.integer("max_picks", max_picks, 1)
    if not callable(policy):
        raise TypeError(f"policy is {policy!r}; expected a function, see unload.policies")
    settings: dict[str, Any] = {
        "equalize": equalize,
        "ties": ties,
        "position_noise": position_noise,
    }
    settings |= {"stack": stack, "max_picks": sys.maxsize if max_picks is None else max_picks}
    arrays = isinstance(physics, str) and physics == "table"

    # Each load has a seed of its own, so that it does not depend on how many are played at once.
    # Other physics are played one container at a time, as a single environment does.
    at_once = task.NUM_ENVS if arrays else 1
    load_seeds = np.random.SeedSequence(seed).generate_state(episodes).tolist()
    frames = []
    for first in range(0, episodes, at_once):
        seeds = load_seeds[first : first + at_once]
        if arrays:
            envs: VectorEnv = ContainerVectorEnv(len(seeds), **settings)
        else:
            make = partial(ContainerEnv, physics, **settings)
            envs = SyncVectorEnv([make], autoreset_mode=AutoresetMode.SAME_STEP)
        with closing(envs):
            frames.append(_play(envs, policy, seeds, mask, give_up=max_picks is None))
    frame = pd.concat(frames, ignore_index=True)
    return frame if max_picks is None else frame.drop(columns=["picks", "emptied"])


class _Chooser:
    """Asks a policy about all episodes in one call, unless it draws random numbers.

    If such a call draws from the generator that it is handed, its answer is thrown away, and from
    then on the policy is asked about one episode at a time, each with a generator of its own.
    """

    def __init__(self, policy: Policy, seeds: list[int]) -> None:
        self._policy = policy
        # Not the numbers that the load of the same seed is made of.
        self._rngs = [np.random.default_rng((seed, 1)) for seed in seeds]
        self._shared = np.random.default_rng(0)
        self._at_first = self._shared.bit_generator.state

    def __call__(self, observations: np.ndarray, allowed: np.ndarray) -> np.ndarray:
        if not self._draws():
            actions = self._ask(observations, allowed, self._shared)
            if not self._draws():
                return actions
        parts = zip(np.split(observations, len(allowed)), np.split(allowed, len(allowed)))
        asked = [self._ask(*part, rng) for part, rng in zip(parts, self._rngs)]
        return np.concatenate(asked)

    def _draws(self) -> bool:
        """Whether the policy has ever drawn from the generator that all episodes share."""
        return self._shared.bit_generator.state != self._at_first

    def _ask(self, observations, allowed, rng) -> np.ndarray:
        """What the policy returns is checked before anything is picked: it may be anybody's."""
        actions, last = self._policy(observations, allowed, rng), task.N_VISIBLE - 1
        return checks.integer_array("what policy returned", actions, (len(allowed),), last)


def _play(
    envs: VectorEnv, policy: Policy, seeds: list[int], mask: bool, give_up: bool
) -> pd.DataFrame:
    """One episode in each environment; what follows after its end does not count."""
    choose = _Chooser(policy, seeds)
    rows = np.arange(len(seeds))
    rewards, deadlocked = [], []  # of each step, (num_envs,)
    running, emptied = np.ones(len(seeds), bool), np.zeros(len(seeds), bool)
    picks, failures = np.zeros((2, len(seeds)), np.int64)  # so far, and failed ones in a row
    observations, infos = envs.reset(seed=seeds)  # type: ignore[arg-type]
    while True:
        # An episode is over where the mask tells the policy that every item has failed.
        allowed = infos["action_mask" if mask else "item_mask"]
        all_failed = ~allowed.any(axis=1)
        running &= ~all_failed
        if not running.any():
            break

        # A policy needs a choice in every row, also where the episode is over.
        actions = choose(observations, choosable(allowed, infos["item_mask"]))

        # The masks of before the pick say whether its item had failed already.
        deadlocked.append(infos["action_mask"][rows, actions] == 0)
        observations, reward, terminations, truncations, infos = envs.step(actions)
        rewards.append(reward)

        # An environment whose episode has ended goes on with the next one, which does not count.
        picks += running
        failures = np.where(reward > 0, 0, failures + 1)
        emptied |= running & terminations
        running &= ~(terminations | truncations)
        if give_up:
            running &= failures < GIVE_UP

    # Of each environment, the picks of its own episode, which came first.
    summaries = []
    for count, reward, repeated in zip(picks, np.transpose(rewards), np.transpose(deadlocked)):
        reward, repeated = reward[:count], repeated[:count]
        # Where a deadlock starts, where it ends, where the next one starts, and so on.
        changes = np.flatnonzero(np.diff(repeated, prepend=0, append=0))
        longest = (changes[1::2] - changes[::2]).max(initial=0)
        summaries.append((success_rate(reward), (reward > 0).sum(), repeated.mean(), longest))
    frame = pd.DataFrame(
        summaries, columns=["success_rate", "unloaded", "deadlocked", "longest_deadlock"]
    )
    return frame.assign(picks=picks, emptied=emptied)
