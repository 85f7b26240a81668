"""Milliseconds per update of the network."""

from collections.abc import Callable
from unittest import mock

import numpy as np
import torch

import unload
from studies.speed.timing import best_times
from unload import task
from unload.agent import learner


def update_times(batch_size: int = 2048, n_features: int = 64) -> dict[str, float]:
    """Time of one ``DQN.update``: gradients of a batch, and a step of Adam.

    Args:
        batch_size: b.
        n_features: n.

    Returns:
        ms, by how it is done.
    """
    rng = np.random.default_rng(0)
    batch = {
        "observations": rng.uniform(-1, 1, (batch_size, task.N_VISIBLE, 3)).astype(np.float32),
        "actions": rng.integers(task.N_VISIBLE, size=batch_size),
        "rewards": rng.choice(np.array([-1, 1], np.float32), batch_size),
    }

    def update(fused: bool, threads: int, rows: int = learner.ROWS_PER_PASS) -> Callable:
        network = unload.PEQNetwork(n_features, torch.Generator().manual_seed(0))
        agent = unload.DQN(network, fused_update=fused)

        def call() -> float:
            torch.set_num_threads(threads)
            with mock.patch.object(learner, "ROWS_PER_PASS", rows):
                return agent.update(batch)

        return call

    times = best_times(
        {
            "PyTorch, whole batch": update(False, 1, batch_size),
            f"PyTorch, chunks of {learner.ROWS_PER_PASS}": update(False, 1),
            "fused": update(True, 1),
            "fused, 2 threads": update(True, 2),
        }
    )
    torch.set_num_threads(1)
    return {name: seconds * 1e3 for name, seconds in times.items()}
