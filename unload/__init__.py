"""Container unloading via reinforcement learning: the paper's task, agent and figures."""

import gymnasium

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
from unload.network.variants import AttentionNetwork, EquivariantStack, TwoLayerScorer

__version__ = "0.1.0"
__all__ = [
    "DQN",
    "AttentionNetwork",
    "ContainerEnv",
    "EquivariantStack",
    "Greedy",
    "HighestItemEnv",
    "Load",
    "PEQNetwork",
    "TrainConfig",
    "TwoLayerScorer",
    "build_load",
    "equalize",
    "evaluate",
    "load_policy",
    "picking_order",
    "policies",
    "read_load",
    "save_policy",
    "stack_load",
    "success_rate",
    "train",
    "view",
]

gymnasium.register(
    id="unload/Container-v0",
    entry_point="unload.env.container:ContainerEnv",
    vector_entry_point="unload.env.vector:ContainerVectorEnv",
)
gymnasium.register(
    id="unload/HighestItem-v0",
    entry_point="unload.env.highest_item:HighestItemEnv",
    vector_entry_point="unload.env.vector:HighestItemVectorEnv",
)
gymnasium.register(id="unload/Heap-v0", entry_point="unload.heap.env:HeapEnv")
