"""How well a policy picks."""

from collections.abc import Callable

import gymnasium
import numpy as np
import pandas as pd

from unload import checks, task
from unload.env import ContainerEnv

Policy = Callable[[np.ndarray, np.ndarray, np.random.Generator], np.ndarray]


def success_rate(rewards: np.ndarray) -> float:
    """Mean success rate MSR = (mean reward + 1) / 2 (Sec. IV-A).

    Args:
        rewards: any shape, not empty, each +1 or -1.

    Raises:
        TypeError: ``rewards`` does not hold numbers.
        ValueError: ``rewards`` is empty or holds another value.
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
    physics: str = "table",
    mask: bool = True,
    max_picks: int = task.MAX_PICKS,
    **env_kwargs,
) -> pd.DataFrame:
    """Let a policy unload fresh containers.

    A pick counts as deadlocked if its item has failed before since the last success:
    the container has not changed, so it fails again (Sec. III-G).

    Args:
        policy: see ``unload.policies``.
        episodes: number of containers.
        seed: of the loads and of the policy's random numbers; episode i is the same
            whatever the number of episodes.
        physics: see ``ContainerEnv``.
        mask: whether the policy is told which items failed since the last success.
        max_picks: picks per episode.
        **env_kwargs: further arguments of ``ContainerEnv``.

    Returns:
        One row per episode: ``success_rate``, ``unloaded`` (items), ``deadlocked``
        (share of picks) and ``longest_deadlock`` (deadlocked picks in a row).

    Raises:
        TypeError, ValueError: an argument is not as described, or ``policy`` returns
            something other than one row of the observation.
    """
    checks.integer("episodes", episodes, 1)
    checks.integer("seed", seed, 0)
    checks.boolean("mask", mask)
    if not callable(policy):
        raise TypeError(f"policy is {policy!r}; expected a function, see unload.policies")
    env = ContainerEnv(physics=physics, max_picks=max_picks, **env_kwargs)
    rows = []
    try:
        for sequence in np.random.SeedSequence(seed).spawn(episodes):
            load_seed, policy_seed = sequence.generate_state(2)
            rng = np.random.default_rng(policy_seed)
            rows.append(_episode(env, policy, int(load_seed), rng, mask))
    finally:
        env.close()
    return pd.DataFrame(rows)


def _episode(
    env: gymnasium.Env, policy: Policy, seed: int, rng: np.random.Generator, mask: bool
) -> dict[str, float]:
    observation, info = env.reset(seed=seed)
    rewards, deadlocked = [], []
    truncated = False
    while not truncated:
        allowed = info["action_mask"] if mask else np.ones_like(info["action_mask"])
        chosen = policy(observation[None], allowed[None], rng)
        (action,) = checks.integer_array("what policy returned", chosen, (1,)).tolist()
        checks.integer("what policy returned", action, 0, task.N_VISIBLE - 1)
        deadlocked.append(not info["action_mask"][action])
        observation, reward, _, truncated, info = env.step(action)
        rewards.append(reward)
    return {
        "success_rate": success_rate(rewards),
        "unloaded": info["unloaded"],
        "deadlocked": float(np.mean(deadlocked)),
        "longest_deadlock": _longest_run(deadlocked),
    }


def _longest_run(flags: list[bool]) -> int:
    longest = current = 0
    for flag in flags:
        current = current + 1 if flag else 0
        longest = max(longest, current)
    return longest
