"""Container unloading via reinforcement learning: the paper's task and agent.

Every name is imported when it is first used, because PyTorch alone takes seconds; so an order of
picks needs none of the libraries that training does.
"""

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING

from unload.support.checks import needed_for
from unload.task import CONTAINER_ENV, HIGHEST_ITEM_ENV
from unload.task import VERSION as __version__

if TYPE_CHECKING:  # what ``_MODULES`` says, for type checkers
    from unload.agent import policies as policies
    from unload.agent.config import TrainConfig as TrainConfig
    from unload.agent.dqn import DQN as DQN
    from unload.agent.evaluation import evaluate as evaluate
    from unload.agent.evaluation import success_rate as success_rate
    from unload.agent.greedy import Greedy as Greedy
    from unload.agent.greedy import load_policy as load_policy
    from unload.agent.greedy import save_policy as save_policy
    from unload.agent.resume import check_resume as check_resume
    from unload.agent.training import train as train
    from unload.drawing.view import view as view
    from unload.env.container import ContainerEnv as ContainerEnv
    from unload.env.equalization import equalize as equalize
    from unload.env.highest_item import HighestItemEnv as HighestItemEnv
    from unload.load.boxes import Load as Load
    from unload.load.substacks import build_load as build_load
    from unload.load.substacks import stack_load as stack_load
    from unload.network.peq import PEQNetwork as PEQNetwork
    from unload.orders.order import picking_order as picking_order
    from unload.orders.packing_list import read_load as read_load

# Where each public name is defined. ``policies`` is a module, which has no such name in it.
_MODULES = {
    "DQN": "agent.dqn",
    "ContainerEnv": "env.container",
    "Greedy": "agent.greedy",
    "HighestItemEnv": "env.highest_item",
    "Load": "load.boxes",
    "PEQNetwork": "network.peq",
    "TrainConfig": "agent.config",
    "build_load": "load.substacks",
    "check_resume": "agent.resume",
    "equalize": "env.equalization",
    "evaluate": "agent.evaluation",
    "load_policy": "agent.greedy",
    "picking_order": "orders.order",
    "policies": "agent.policies",
    "read_load": "orders.packing_list",
    "save_policy": "agent.greedy",
    "stack_load": "load.substacks",
    "success_rate": "agent.evaluation",
    "train": "agent.training",
    "view": "drawing.view",
}
__all__ = ["__version__", *_MODULES]


def _imported(name: str) -> object:
    """Import a public name (PEP 562)."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    with needed_for(f"unload.{name}"):
        module = import_module(f"unload.{_MODULES[name]}")
    value = getattr(module, name, module)
    globals()[name] = value  # found without this function the next time
    return value


if not TYPE_CHECKING:  # which would take any name for one of ours
    __getattr__ = _imported


def __dir__() -> list[str]:
    return sorted(__all__)


def _register() -> None:
    """Register the environments, where Gymnasium is installed: an order does without it."""
    if find_spec("gymnasium") is None:
        return
    import gymnasium

    for name, single, arrays in (
        (CONTAINER_ENV, "container:ContainerEnv", "vector:ContainerVectorEnv"),
        (HIGHEST_ITEM_ENV, "highest_item:HighestItemEnv", "highest_item:HighestItemVectorEnv"),
    ):
        entry, vector_entry = f"unload.env.{single}", f"unload.env.{arrays}"
        gymnasium.register(name, entry, vector_entry_point=vector_entry)


_register()
