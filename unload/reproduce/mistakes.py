"""The mistakes of a policy with the mask: often it tries the same boxes again."""

import numpy as np
import pandas as pd

from unload.agent.evaluation import Policy
from unload.agent.greedy import Greedy
from unload.env.vector import ContainerVectorEnv
from unload.support import checks


def mistakes(policy: Policy, episodes: int, seed: int) -> pd.Series:
    """Let a policy unload fresh containers with the mask, and say what fails.

    A success clears the mask (Sec. III-G), so that a box which has failed may be picked again
    although nothing that lies on it has been taken away.

    Args:
        policy: see ``unload.policies``.
        episodes: containers, side by side.
        seed: of their loads, which are those of ``unload.evaluate``, and of the policy's random
            numbers.

    Returns:
        ``failed``, the share of picks that fail; ``first_failed``, the same of the first picks in
        a state, which are those of an episode and those after a success; ``repeated``, the share
        of failed picks whose box has failed before in the episode, NaN without a failure; and
        ``value_failed``, the median of the values that the network of a trained policy gave to
        the picks that failed, NaN without a failure or a network.

    Raises:
        TypeError, ValueError: an argument is not as described.
    """
    episodes, seed = checks.integer("episodes", episodes, 1), checks.integer("seed", seed, 0)
    rng, rows = np.random.default_rng(seed), np.arange(episodes)
    envs = ContainerVectorEnv(episodes)
    loads = np.random.SeedSequence(seed).generate_state(episodes).tolist()
    observations, infos = envs.reset(seed=loads)
    tried = [set() for _ in rows]  # boxes that have failed
    first, steps, values = np.ones(episodes, bool), [], []
    for _ in range(envs.max_picks - 1):  # the last pick would begin the next episode
        actions = policy(observations, infos["action_mask"].astype(bool), rng)
        boxes = envs.visible[rows, actions].tolist()
        seen = observations
        observations, rewards, *_, infos = envs.step(actions)
        failed = rewards < 0
        if isinstance(policy, Greedy) and failed.any():
            values += policy.values(seen[failed])[np.arange(failed.sum()), actions[failed]].tolist()
        known = [box in each for box, each in zip(boxes, tried)]
        steps.append((failed, first, known))
        for row in np.flatnonzero(failed):
            tried[row].add(boxes[row])
        first = ~failed
    envs.close()
    failed, first, known = map(np.array, zip(*steps))
    return pd.Series(
        {
            "failed": failed.mean(),
            "first_failed": failed[first].mean(),
            "repeated": known[failed].mean() if failed.any() else np.nan,
            "value_failed": np.median(values) if values else np.nan,
        }
    )
