"""The order in which a policy unloads one load, to the last box."""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

from unload.agent import policies
from unload.agent.evaluation import Policy
from unload.agent.greedy import load_policy
from unload.env.container import ContainerEnv
from unload.load.boxes import Load, check_load
from unload.support import checks

BY_RULE = {rule.__name__: rule for rule in (policies.highest, policies.nearest, policies.random)}


def picking_order(load: Load, policy: str | Path | Policy = "recommended", seed: int = 0):
    """Unload a load by a policy, and write down the picks.

    The policy sees each box exactly where it is. An item that has failed is not picked again
    before another one has been unloaded.

    Args:
        load: see ``unload.read_load``.
        policy: ``"highest"``, ``"nearest"`` or ``"random"``, what ``unload.load_policy`` reads, or
            a function, see ``unload.policies``.
        seed: of the policy's random numbers; a greedy policy draws none.

    Returns:
        A ``pandas.DataFrame`` with a row for each pick: ``pick``, counted from 1; ``id`` of the
        box, the number of its item if the load has no ids; ``item``, its row in the load;
        ``distance`` in m by which it was lifted; and ``unloaded``, False for a pick that failed.
        Boxes are left out only where a container gets stuck: all visible boxes have failed then,
        and they are the last rows.

    Raises:
        TypeError, ValueError: an argument is not as described.
        FileNotFoundError: there is no such policy.
    """
    check_load(load)
    rng = np.random.default_rng(checks.integer("seed", seed, 0))
    if isinstance(policy, (str, Path)):
        policy = BY_RULE[policy] if policy in BY_RULE else load_policy(policy)
    elif not callable(policy):
        raise TypeError(f"policy is {policy!r}; expected a name, a path or a function")
    env = ContainerEnv("table", max_picks=sys.maxsize, position_noise=0.0)
    observation, info = env.reset(options={"load": load})
    picks, emptied = [], False
    while not emptied and info["action_mask"].any():
        chosen = policy(observation[np.newaxis], info["action_mask"][np.newaxis], rng)
        chosen = checks.integer_array("what policy returned", chosen, (1,))
        observation, reward, emptied, _, info = env.step(chosen[0])
        picks.append((info["item"], info["distance"], reward > 0))
    env.close()
    table = pd.DataFrame(picks, columns=["item", "distance", "unloaded"])
    table.insert(0, "pick", np.arange(1, len(table) + 1))
    table.insert(1, "id", table["item"] if load.ids is None else load.ids[table["item"]])
    return table
