"""Container unloading via reinforcement learning: the paper's task, agent and figures.

Every name is imported when it is first used, because PyTorch alone takes seconds.
"""

from importlib import import_module
from typing import TYPE_CHECKING

import gymnasium

from unload.task import VERSION as __version__

# ruff: noqa: F401
if TYPE_CHECKING:  # what ``_PLACES`` says, for type checkers
    from unload.agent import policies
    from unload.agent.config import TrainConfig
    from unload.agent.dqn import DQN
    from unload.agent.evaluation import evaluate, success_rate
    from unload.agent.greedy import Greedy, load_policy, save_policy
    from unload.agent.order import picking_order
    from unload.agent.training import train
    from unload.env.container import ContainerEnv
    from unload.env.equalization import equalize
    from unload.env.highest_item import HighestItemEnv
    from unload.load.boxes import Load
    from unload.load.packing_list import read_load
    from unload.load.substacks import build_load, stack_load
    from unload.load.view import view
    from unload.network.peq import PEQNetwork

# Where each public name is defined; a module has itself.
_PLACES = {
    "DQN": "agent.dqn",
    "ContainerEnv": "env.container",
    "Greedy": "agent.greedy",
    "HighestItemEnv": "env.highest_item",
    "Load": "load.boxes",
    "PEQNetwork": "network.peq",
    "TrainConfig": "agent.config",
    "build_load": "load.substacks",
    "equalize": "env.equalization",
    "evaluate": "agent.evaluation",
    "load_policy": "agent.greedy",
    "picking_order": "agent.order",
    "policies": "agent.policies",
    "read_load": "load.packing_list",
    "save_policy": "agent.greedy",
    "stack_load": "load.substacks",
    "success_rate": "agent.evaluation",
    "train": "agent.training",
    "view": "load.view",
}
__all__ = ["__version__", *_PLACES]


def __getattr__(name: str) -> object:
    """Import a public name (PEP 562)."""
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = import_module(f"unload.{_PLACES[name]}")
    value = getattr(module, name, module)
    globals()[name] = value  # found without this function the next time
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_PLACES})


for _id, _entry, _arrays in (
    ("unload/Container-v0", "container:ContainerEnv", "vector:ContainerVectorEnv"),
    ("unload/HighestItem-v0", "highest_item:HighestItemEnv", "highest_item:HighestItemVectorEnv"),
):
    gymnasium.register(_id, f"unload.env.{_entry}", vector_entry_point=f"unload.env.{_arrays}")
