"""The margin of a neat load: why many rules never fail there, and what is left of it in ranks."""

from collections.abc import Iterator

import numpy as np

from unload import task
from unload.agent.evaluation import Policy
from unload.env.container import ContainerEnv
from unload.load.boxes import ABOVE, Load
from unload.network.peq import PEQNetwork


def steps_of(load: Load) -> np.ndarray:
    """Steps from a box to one that lies on it: to the side (y) and up (z), (pairs, 2) in m."""
    below, above = load.contacts.pairs(ABOVE)
    return (load.positions[above] - load.positions[below])[:, 1:]


def own_scores(network: PEQNetwork, rows: np.ndarray) -> np.ndarray:
    """What decides between boxes: the scorer's weights times a box's own features, (n,).

    Args:
        network: of the paper.
        rows: (n, 3) of an observation, ranks or positions.
    """
    weight, bias, scorer = (
        each.detach().numpy()
        for each in (network.extractor.weight, network.extractor.bias, network.scorer.weight)
    )
    return np.maximum(rows @ weight.T + bias, 0) @ scorer[0, : network.n_features]


def containers(
    policy: Policy,
    seed: int,
    max_picks: int = task.MAX_PICKS,
    policy_seed: int | tuple[int, ...] | None = None,
) -> Iterator[tuple[ContainerEnv, np.ndarray, int]]:
    """A container as it stands before each pick: environment, (128, 3) observation and action.

    Args:
        policy: picks with the mask.
        seed: of the load.
        max_picks: at most; fewer if the container is empty before.
        policy_seed: of the policy's random numbers, ``seed`` if None.
    """
    rng = np.random.default_rng(seed if policy_seed is None else policy_seed)
    env, ended = ContainerEnv("table", max_picks=max_picks), False
    observation, info = env.reset(seed=seed)
    while not ended:
        action = int(policy(observation[None], info["action_mask"][None], rng)[0])
        yield env, observation, action
        observation, _, terminated, truncated, info = env.step(action)
        ended = terminated or truncated


def pairs_in_sight(env: ContainerEnv) -> np.ndarray:
    """Rows of visible boxes with visible ones on them, and the rows of those, (2, pairs)."""
    row = {item: number for number, item in enumerate(env.visible.tolist())}
    contacts, present = env.load.contacts, env.present
    pairs = [
        (row[item], row[above])
        for item in row
        for above in contacts.of(ABOVE, item).tolist()
        if present[above]
    ]
    return np.array(pairs).reshape(-1, 2).T
