"""Policies compared with every box simulated.

    python -m studies policies

In ``full`` physics all boxes are free to move. With ``after_pick="restore"`` they are put
back after every pick; with ``"keep"`` they stay where the pick has left them. They drift,
and a box on which nothing lies may be jammed between its neighbours.
"""

from collections.abc import Callable
from itertools import product

import numpy as np
import pandas as pd

from studies.policies.comparison import LEARNED, SIMPLE, digests, find_policy
from studies.results import COMMAND, keep_all, publish
from unload.agent.evaluation import Policy, success_rate
from unload.env.container import ContainerEnv
from unload.load.boxes import Load
from unload.load.substacks import stack_load
from unload.physics.bullet import SETTINGS
from unload.physics.situation import Surroundings

EPISODES, PICKS = 10, 100  # of each policy; only the front walls of a load are simulated
SEED = 2000  # of the loads; no other data uses it
# They hold all boxes that are seen during 100 picks, whatever is picked: the nearest 228 are in the
# front 6. With a seventh behind them, ``full`` physics is nearly twice as fast as with all.
FRONT_WALLS = 7
COLUMNS = ["policy", "after_pick", "episode", "success_rate", "free", "jammed"]
# Who plays how; of the others, every decision with boxes restored would be the table's.
PLAYED = (*((name, "keep") for name in (*SIMPLE, *LEARNED)), ("recommended", "restore"))


def robustness_data(n_jobs: int = 1) -> None:
    """Let policies unload the same containers: ``policies/robustness.csv``.

    One row per ``policy``, ``after_pick`` and ``episode``, with the columns of ``play``. An
    episode takes minutes. Each one that is finished is kept, so that a run that was stopped
    goes on.
    """
    weights = digests()
    seeds = np.random.SeedSequence(SEED).generate_state(EPISODES).tolist()
    containers, asked = [], []
    for (name, after_pick), (episode, seed) in product(PLAYED, enumerate(seeds)):
        containers.append({"policy": name, "after_pick": after_pick, "episode": episode})
        size = {"seed": seed, "picks": PICKS, "walls": FRONT_WALLS, "settings": SETTINGS}
        question = containers[-1] | size | {"weights": weights.get(name)}
        asked.append((question, (find_policy(name), after_pick, seed, PICKS)))
    answers = keep_all("robustness", play, asked, n_jobs)
    rows = [one | answer.value for one, answer in zip(containers, answers)]
    tables = {"robustness": pd.DataFrame(rows)[COLUMNS]}
    settings = {"policies": weights, "episodes": EPISODES, "picks": PICKS, "seed": SEED}
    settings["front walls"] = FRONT_WALLS
    publish("policies/robustness", tables, f"{COMMAND} policies", settings, answers)


def front_walls(load: Load, count: int = FRONT_WALLS) -> Load:
    """The ``count`` item walls nearest to the entrance, where they stand; no others."""
    kept = load.walls >= np.unique(load.walls)[-count]
    return Load(load.positions[kept], load.sizes[kept], load.packages[kept], load.walls[kept])


def play(
    policy: Policy,
    after_pick: str,
    seed: int,
    picks: int,
    stack: Callable[[np.random.Generator], Load] = lambda rng: front_walls(stack_load(rng)),
) -> dict[str, float]:
    """Let a policy unload one container, with the mask.

    Args:
        policy: see ``unload.policies``.
        after_pick: ``"keep"`` or ``"restore"``, see ``FullPhysics``.
        seed: of the load and of the policy's random numbers.
        picks: how many, fewer than the load has items.
        stack: makes the load, see ``ContainerEnv``; the front walls of one of the paper's loads.

    Returns:
        ``success_rate``; ``free`` and ``jammed``, the shares of picks at items on which nothing
        rested in the neat load but what has been unloaded since, and of those that failed
        nevertheless.
    """
    rng = np.random.default_rng([seed])
    rewards, free = [], []
    env = ContainerEnv("full", after_pick, max_picks=picks, stack=stack)
    observation, info = env.reset(seed=seed)

    # What rests on a box is asked of the neat load, because drifting boxes touch their neighbours.
    around = Surroundings(env.physics.load, env.physics.present)
    for _ in range(picks):
        allowed = info["action_mask"]
        action = int(policy(observation[np.newaxis], allowed[np.newaxis], rng)[0])
        free.append(not around.on_top(int(env.visible[action])))
        observation, reward, _, _, info = env.step(action)
        rewards.append(reward)
    return {
        "success_rate": success_rate(rewards),
        "free": float(np.mean(free)),
        "jammed": float(np.mean(free & (np.array(rewards) < 0))),
    }
