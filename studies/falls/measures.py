"""What is measured of a network and of the containers that its policy leaves behind."""

from collections.abc import Callable

import gymnasium
import numpy as np
import torch
from torch import nn

from studies.changes import left, without
from unload import task
from unload.agent.config import TrainConfig
from unload.agent.evaluation import Policy, evaluate
from unload.agent.greedy import greedy_actions
from unload.env.equalization import equalize
from unload.network.peq import PEQNetwork

Seen = Callable[[np.ndarray], np.ndarray]
HEIGHT_BINS = 12
BLANKED = {"as_is": (), "x": (0,), "y": (1,), "place": (0, 1)}  # coordinates set to 0 in choosing
LOADS = {"episodes": 16, "seed": 1000}  # of fresh containers, 500 picks each


def slopes(network: PEQNetwork, observations: np.ndarray) -> np.ndarray:
    """Mean slope of the score along x, y and z over the upper half of the items, (3,).

    The score is what decides among the items of an observation: tanh's argument without the pooled
    part, which moves all of them alike.

    Args:
        network: the paper's.
        observations: (k, items, 3) of the dtype of its weights, ranks or positions.
    """
    heights = observations[..., 2]
    upper = heights > np.median(heights)
    items = torch.from_numpy(observations[upper]).requires_grad_()
    own = torch.relu(network.extractor(items))
    scores = own @ network.scorer.weight[0, : network.n_features]
    (gradient,) = torch.autograd.grad(scores.sum(), items)
    return gradient.numpy().mean(axis=0)


def tilt(observations: np.ndarray, liftable: np.ndarray) -> np.ndarray:
    """How far x and y tell which of the items at the same height can be lifted, (2,).

    The coefficients of x and y in a least-squares fit of ``liftable``, 0 or 1, with a constant for
    each of 12 bins of the height.

    Args:
        observations: (k, items, 3), ranks or positions.
        liftable: (k, items) bool.
    """
    place, height = observations[..., :2].reshape(-1, 2), observations[..., 2].ravel()
    edges = np.linspace(height.min(), height.max(), HEIGHT_BINS + 1)[1:-1]
    bins = np.eye(HEIGHT_BINS)[np.digitize(height, edges)]
    fit = np.linalg.lstsq(np.hstack([bins, place]), liftable.ravel().astype(float), rcond=None)
    return fit[0][-2:]


def mistakes(
    network: nn.Module, observations: np.ndarray, liftable: np.ndarray
) -> tuple[float, float, float]:
    """Share of observations whose favourite cannot be lifted, as it is and without place.

    Returns:
        Both shares, and the mean height of the favourites that cannot be lifted, NaN without any.
    """
    rows, everything = np.arange(len(observations)), np.ones_like(liftable)
    best = greedy_actions(network, observations, everything)
    by_height = greedy_actions(network, without(observations), everything)
    wrong, wrong_by_height = ~liftable[rows, best], ~liftable[rows, by_height]
    heights = observations[rows, best, 2][wrong]
    return wrong.mean(), wrong_by_height.mean(), heights.mean() if len(heights) else np.nan


def judged(
    network: nn.Module,
    config: TrainConfig,
    blank: tuple[int, ...] = (),
    seen: Seen | None = None,
    loads: dict = LOADS,
) -> float:
    """MSR of a trained network's choices in fresh containers.

    Args:
        network: of the policy.
        config: that it was trained with, which says what is seen and whether the mask is on.
        blank: coordinates that are set to 0.
        seen: what the network saw of the observations, if they were changed.
        loads: ``episodes`` and ``seed`` of the containers, see ``unload.evaluate``.
    """

    def policy(observations, masks, rng):
        if seen is not None:
            observations = seen(observations)
        return greedy_actions(network, without(observations, blank), masks)

    env = {"equalize": config.equalize, "ties": config.ties}
    return evaluate(policy, mask=config.mask, **loads, **env)["success_rate"].mean()


def preferring(along_x: float, along_y: float, ties: str = "noise") -> Policy:
    """The rule that picks the highest z + along_x · x + along_y · y of ``equalize``'s ranks."""
    weights = np.array([along_x, along_y, 1], np.float32)

    def policy(observations: np.ndarray, masks: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        scores = np.array([equalize(seen, ties) for seen in observations]) @ weights
        return np.where(masks.astype(bool), scores, -np.inf).argmax(axis=1)

    return policy


def rules(ties: str, along_x: np.ndarray, along_y: np.ndarray, containers: int = 4) -> np.ndarray:
    """MSR of the rules ``preferring``, with the mask, in containers of their own.

    Args:
        ties: see ``unload.equalize``.
        along_x, along_y: the preferences, two arrays of the same shape.
        containers: for each rule.

    Returns:
        float64 in [0, 1], of that shape.
    """
    weights = np.stack([along_x, along_y, np.ones_like(along_x)], -1, dtype=np.float32)
    weights = weights.reshape(-1, 1, 3).repeat(containers, axis=0)
    envs = gymnasium.make_vec("unload/Container-v0", len(weights), equalize=True, ties=ties)
    observations, infos = envs.reset(seed=0)
    successes = np.zeros(len(weights))
    for _ in range(task.MAX_PICKS):
        scores = (observations * weights).sum(axis=2)
        actions = np.where(infos["action_mask"] == 1, scores, -np.inf).argmax(axis=1)
        observations, rewards, _, _, infos = envs.step(actions)
        successes += rewards > 0
    envs.close()
    return successes.reshape(*along_x.shape, containers).mean(axis=-1) / task.MAX_PICKS


def surface(policy: Policy, containers: int = 8) -> np.ndarray:
    """How high a policy leaves the loads after 300 picks, seen from above.

    Args:
        policy: see ``unload.policies``; it plays with the mask on.
        containers: how many.

    Returns:
        (70, 25) float64 in m, the mean height of the highest box at each place. Places are 0.1 m
        long and wide; the first ones lie at the rear and at the left wall.
    """
    along, across = ((np.arange(count) + 0.5) / 10 for count in (70, 25))
    heights = np.zeros((containers, len(along), len(across)))
    for seed, highest in enumerate(heights):
        load = left(policy, 300, seed)
        for centre, size in zip(load.positions, load.sizes):
            deep, wide = np.abs(along - centre[0]), np.abs(across - centre[1])
            covered = np.outer(deep < size[0] / 2, wide < size[1] / 2)
            highest[covered] = np.maximum(highest[covered], centre[2] + size[2] / 2)
    return heights.mean(axis=0)
