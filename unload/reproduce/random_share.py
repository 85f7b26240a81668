"""Training with a constant share of random picks.

``random_picks.fit`` fits a network to random picks that it has no part in. Here the network
shapes the containers that it learns in, by the picks that are not random; or a teacher does.
"""

from typing import NamedTuple

import gymnasium
import numpy as np
import torch

from unload import task
from unload.agent.dqn import DQN
from unload.agent.evaluation import Policy
from unload.agent.greedy import greedy_actions
from unload.agent.policies import random
from unload.agent.replay import ReplayBuffer
from unload.network.peq import PEQNetwork
from unload.reproduce.random_picks import TRANSFORMS, greedy
from unload.support import checks

REMEMBER = ("all", "random")


class Learned(NamedTuple):
    """Result of ``learn``.

    Attributes:
        policy: greedy, by the network's values.
        probes: (k, 4) float32, of the random picks in the last two thirds of the training:
            the item's x, y, z as the network saw them, and 1 if it was unloaded, else 0.
    """

    policy: Policy
    probes: np.ndarray


def learn(
    features: str,
    epsilon: float,
    seed: int,
    picks: int,
    batch_size: int = 256,
    mask: bool = False,
    remember: str = "all",
    network: torch.nn.Module | None = None,
    teacher: Policy | None = None,
) -> Learned:
    """Train as the paper does, but with a constant share of random picks.

    Args:
        features: a name in ``random_picks.TRANSFORMS``.
        epsilon: the share of random picks.
        seed: of the loads, the picks, the batches and the weights.
        picks: over all 64 containers, a multiple of 64; one update per 64 of them.
        batch_size: b.
        mask: whether items that failed since the last success are masked.
        remember: ``"all"`` picks, or the ``"random"`` ones only.
        network: what to train, and what is changed; the paper's with random weights if None.
        teacher: makes the picks that are not random; the network itself if None.

    Raises:
        TypeError, ValueError: an argument is not as described.
    """
    checks.one_of("features", features, TRANSFORMS)
    checks.real("epsilon", epsilon, 0, 1)
    checks.integer("picks", picks, task.NUM_ENVS)
    checks.integer("batch_size", batch_size, 1)
    checks.boolean("mask", mask)
    checks.one_of("remember", remember, REMEMBER)
    transform, rows = TRANSFORMS[features], np.arange(task.NUM_ENVS)
    rng = np.random.default_rng(checks.integer("seed", seed, 0))
    if network is None:
        network = PEQNetwork(generator=torch.Generator().manual_seed(seed))
    agent = DQN(network)
    envs = gymnasium.make_vec("unload/Container-v0", task.NUM_ENVS)
    observed, infos = envs.reset(seed=int(rng.integers(2**31)))
    replay, probes = ReplayBuffer(picks, task.N_VISIBLE), []
    for _ in range(picks // task.NUM_ENVS):
        seen, allowed = transform(observed), infos["action_mask" if mask else "item_mask"]
        explores = rng.random(task.NUM_ENVS) < epsilon
        if teacher is None:
            chosen = greedy_actions(network, seen, allowed)
        else:
            chosen = teacher(observed, allowed, rng)
        actions = np.where(explores, random(observed, allowed, rng), chosen)
        observed, rewards, _, _, infos = envs.step(actions)
        kept = explores if remember == "random" else slice(None)
        replay.add(observations=seen[kept], actions=actions[kept], rewards=rewards[kept])
        agent.update(replay.sample(batch_size, rng))
        probes.append(np.column_stack([seen[rows, actions], rewards > 0])[explores])
    envs.close()
    return Learned(greedy(network, features), np.concatenate(probes[len(probes) // 3 :]))
