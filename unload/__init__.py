"""Container unloading via reinforcement learning: the paper's task, agent and figures."""

import gymnasium

from unload import policies
from unload.agent import DQN, Greedy, load_policy, save_policy
from unload.architectures import AttentionNetwork, EquivariantStack, TwoLayerScorer
from unload.config import TrainConfig
from unload.env import ContainerEnv
from unload.equalization import equalize
from unload.evaluate import evaluate, success_rate
from unload.highest_item import HighestItemEnv
from unload.network import PEQNetwork
from unload.substacks import Load, build_load, stack_load
from unload.train import train
from unload.view import view

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
    "policies",
    "save_policy",
    "stack_load",
    "success_rate",
    "train",
    "view",
]

gymnasium.register(
    id="unload/Container-v0",
    entry_point="unload.env:ContainerEnv",
    vector_entry_point="unload.vector_env:ContainerVectorEnv",
)
gymnasium.register(
    id="unload/HighestItem-v0",
    entry_point="unload.highest_item:HighestItemEnv",
    vector_entry_point="unload.vector_env:HighestItemVectorEnv",
)
