"""Where a training step's time goes, beside the least time that it could take."""

import tempfile
import time
from collections import defaultdict
from contextlib import ExitStack
from functools import wraps
from unittest import mock

import numpy as np
import pandas as pd
import torch

import unload
from benchmarks.floors import bytes_per_second, operations_per_second
from unload import task
from unload.agent.fast import fused
from unload.agent.fast.adam import Adam
from unload.agent.replay import ReplayBuffer
from unload.env.vector import ContainerVectorEnv

# The fewest operations for one feature of one item. To learn: three multiply-adds make it; it
# is compared with the lowest, the highest and 0; the item counts, and its x, y, z are added,
# if it is active. To choose: three multiply-adds, ReLU, a multiply-add with the score's weight.
LEARN, CHOOSE = 3 + 3 + 4, 3 + 1 + 1
OBSERVATION = task.N_VISIBLE * 3 * 4  # bytes
WARM_UP = 100  # steps that do not count
PARTS = {
    "choose": (unload.DQN, "choose"),
    "step": (ContainerVectorEnv, "step"),
    "add": (ReplayBuffer, "add"),
    "sample": (ReplayBuffer, "sample_rows"),
    "gradients": (fused, "add_chunks"),
    "Adam": (Adam, "step"),
}


def step_profile(picks: int = 128_000) -> pd.DataFrame:
    """Time of the parts of one step of the paper's training: 64 picks and an update.

    ``unload.train`` runs on one thread, its parts timed as they are called.

    Args:
        picks: of the training.

    Returns:
        One row per part: ``part``, ``us`` as measured, ``floor_us`` and ``floor``: the time
        for the operations or the bytes alone, and what is counted.
    """
    torch.set_num_threads(1)
    config = unload.TrainConfig(picks=picks)
    seconds, total = _timed_training(config)
    measured = {
        "choose": seconds["choose"],
        "environments": seconds["step"],
        "remember": seconds["add"],
        "sample": seconds["sample"],
        "gradients": seconds["gradients"],
        "Adam": seconds["Adam"],
    }
    measured["rest"] = total - sum(measured.values())
    floors = _floors(config)
    rows = [
        {
            "part": part,
            "us": 1e6 * spent,
            "floor_us": 1e6 * floors[part][0],
            "floor": floors[part][1],
        }
        for part, spent in measured.items()
    ]
    return pd.DataFrame(rows)


def _timed_training(config: unload.TrainConfig) -> tuple[dict[str, float], float]:
    """Seconds per step in each of ``PARTS``, and in all."""
    calls: dict[str, list[tuple[float, float]]] = defaultdict(list)

    def timed(name: str, call):
        @wraps(call)
        def timed_call(*arguments, **keywords):
            start = time.perf_counter()
            result = call(*arguments, **keywords)
            calls[name].append((start, time.perf_counter()))
            return result

        return timed_call

    with ExitStack() as stack, tempfile.TemporaryDirectory() as folder:
        for name, (owner, attribute) in PARTS.items():
            wrapper = timed(name, getattr(owner, attribute))
            stack.enter_context(mock.patch.object(owner, attribute, wrapper))
        unload.train(config, folder, progress=False)
    begin, end = calls["choose"][WARM_UP][0], calls["choose"][-1][0]
    steps = len(calls["choose"]) - 1 - WARM_UP
    spent = {
        name: sum(stop - start for start, stop in times if begin <= start < end) / steps
        for name, times in calls.items()
    }
    return spent, (end - begin) / steps


def _floors(config: unload.TrainConfig) -> dict[str, tuple[float, str]]:
    """The least seconds of each part, and what they are for."""
    operation, byte = 1 / operations_per_second(), 1 / bytes_per_second()
    features = task.N_VISIBLE * config.n_features
    epsilons = [config.epsilon(picks) for picks in range(0, config.picks, config.num_envs)]
    greedy = config.num_envs * (1 - float(np.mean(epsilons)))
    written = config.num_envs * OBSERVATION
    weights = 8 * config.n_features + 1
    return {
        "choose": (CHOOSE * greedy * features * operation, f"{CHOOSE} operations per feature"),
        "environments": (2 * written * byte, "write the observations"),
        "remember": (2 * written * byte, "copy the observations"),
        "sample": (8 * config.batch_size * byte, "write the rows' numbers"),
        "gradients": (
            LEARN * config.batch_size * features * operation,
            f"{LEARN} operations per feature",
        ),
        "Adam": (48 * weights * byte, "read and write the weights and moments"),
        "rest": (0.0, "nothing"),
    }
