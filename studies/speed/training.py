"""Picks per second of whole trainings, ours and Stable-Baselines3's."""

import tempfile
import time
from unittest import mock

import numpy as np
import stable_baselines3
import torch
from stable_baselines3.common.callbacks import BaseCallback

import unload
from studies.speed.stable_baselines import PEQPolicy
from unload.env.sb3 import ContainerVecEnv
from unload.fast import fused


def training_rates(
    ours: int = 256_000,
    memory: int = unload.TrainConfig().replay_size,
    plain: int = 3_200,
    before: int = 3_200,
    theirs: int = 960,
) -> dict[str, float]:
    """Picks per second in the paper's configuration, from end to end.

    Both train the same network on the same 64 containers, with one update per 64 picks on
    a batch of 2048, as soon as there are 2048 picks to learn from; the picks before that
    do not count. With the fused update, those before the replay memory is full do not count,
    either: what the system takes to hand out the memory is nothing beside the paper's 20
    million picks. Exploration falls over the picks made here as it does in the paper. Ours is
    the median over episodes, theirs over steps: what else runs on the machine stalls a few.

    Args:
        ours: picks that count of our training with the fused update.
        memory: picks made before them.
        plain: picks that count with plain PyTorch's update.
        before: picks made before those.
        theirs: of Stable-Baselines3's DQN.

    Returns:
        By who trains and how.
    """
    rates = {}
    for threads in (1, 2):
        name = f"{threads} thread{'s' * (threads > 1)}"
        rates[f"Stable-Baselines3, {name}"] = _their_rate(theirs, threads)
    with mock.patch.object(fused, "applies", return_value=False):
        rates["here, PyTorch's update, 1 thread"] = _our_rate(plain, 1, before)
    for threads in (1, 2):
        name = f"{threads} thread{'s' * (threads > 1)}"
        rates[f"here, fused update, {name}"] = _our_rate(ours, threads, memory)
    torch.set_num_threads(1)
    return rates


def _our_rate(picks: int, threads: int, before: int) -> float:
    torch.set_num_threads(threads)
    steps = picks // unload.TrainConfig().num_envs
    config = unload.TrainConfig(picks=picks + before, log_interval=min(10, steps))
    with tempfile.TemporaryDirectory() as folder:
        curve = unload.train(config, folder, progress=False).curve
    times = curve.loc[curve["picks"] >= before, "wall_time"].to_numpy()
    episode = min(config.max_picks // config.log_interval, len(times) - 1)  # points of the curve
    seconds = np.median(times[episode:] - times[:-episode])
    return episode * config.log_interval * config.num_envs / float(seconds)


class _Clock(BaseCallback):
    """Notes the time of each step."""

    def __init__(self) -> None:
        super().__init__()
        self.times: list[float] = []

    def _on_step(self) -> bool:
        self.times.append(time.perf_counter())
        return True


def _their_rate(picks: int, threads: int) -> float:
    torch.set_num_threads(threads)
    config = unload.TrainConfig()
    envs = ContainerVecEnv(config.num_envs, equalize=config.equalize)
    model = stable_baselines3.DQN(
        PEQPolicy,
        envs,
        learning_rate=config.learning_rate,
        buffer_size=config.replay_size,
        learning_starts=config.batch_size,
        batch_size=config.batch_size,
        gamma=config.gamma,
        train_freq=1,  # of all environments
        gradient_steps=config.gradient_steps,
        target_update_interval=config.target_update_interval,
        exploration_fraction=config.epsilon_fraction,
        exploration_initial_eps=config.epsilon_init,
        exploration_final_eps=config.epsilon_final,
        policy_kwargs={"net_arch": [config.n_features]},
        device="cpu",
        seed=config.seed,
    )
    clock = _Clock()
    warm = config.batch_size + 2 * config.num_envs  # two updates do not count
    model.learn(warm + picks, clock)
    envs.close()
    steps = np.diff(clock.times)[-(picks // config.num_envs) :]
    return config.num_envs / float(np.median(steps))
