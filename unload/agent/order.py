"""The order in which a policy unloads one load, to the last box."""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

from unload.agent import policies
from unload.agent.evaluation import Policy
from unload.agent.greedy import SHIPPED, load_policy
from unload.env.container import ContainerEnv
from unload.load.boxes import Load, check_load
from unload.support import checks

BY_RULE = {rule.__name__: rule for rule in (policies.highest, policies.nearest, policies.random)}
NAMES = (*BY_RULE, *SHIPPED)


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
        TypeError, ValueError: an argument is not as described, or ``policy`` returns
            something other than a row that its mask allows.
        FileNotFoundError: there is no such policy; the message lists the names.
    """
    check_load(load)
    rng = np.random.default_rng(checks.integer("seed", seed, 0))
    if isinstance(policy, (str, Path)):
        if str(policy) not in NAMES and not Path(policy).is_file():
            raise FileNotFoundError(
                f"policy is {str(policy)!r}; expected a .safetensors file of a policy, or one of "
                + ", ".join(map(repr, NAMES))
            )
        policy = BY_RULE.get(str(policy)) or load_policy(policy)
    elif not callable(policy):
        raise TypeError(f"policy is {policy!r}; expected a name, a path or a function")
    env = ContainerEnv("table", max_picks=sys.maxsize, position_noise=0.0)
    observation, info = env.reset(options={"load": load})
    picks, emptied = [], False
    while not emptied and info["action_mask"].any():
        chosen = policy(observation[np.newaxis], info["action_mask"][np.newaxis], rng)
        row = int(checks.integer_array("what policy returned", chosen, (1,))[0])
        if row not in np.flatnonzero(info["action_mask"]):
            raise ValueError(f"what policy returned is {row}; expected a row that the mask allows")
        observation, reward, emptied, _, info = env.step(row)
        picks.append((info["item"], info["distance"], reward > 0))
    env.close()
    table = pd.DataFrame(picks, columns=["item", "distance", "unloaded"])
    table.insert(0, "pick", np.arange(1, len(table) + 1))
    table.insert(1, "id", table["item"] if load.ids is None else load.ids[table["item"]])
    return table
