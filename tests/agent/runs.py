"""What the tests of training share: small networks and runs, and ways to stop them."""

import itertools
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch

from unload import PEQNetwork, TrainConfig, stack_load, train
from unload.agent import training
from unload.agent.training import Training

ROOT = Path(__file__).resolve().parents[2]
# Small runs that still meet every event: episode ends, updates, points of the curve and,
# with gamma > 0, updates of the target network.
CONTAINER = {
    "num_envs": 4, "batch_size": 16, "replay_size": 100, "n_features": 4, "log_interval": 5,
    "picks": 200, "max_picks": 12, "target_update_interval": 24,
}  # fmt: skip
RUNS = {
    "container": CONTAINER,
    "container, masked": CONTAINER | {"mask": True, "equalize": False, "gradient_steps": 2},
    "container, gamma": CONTAINER | {"gamma": 0.9, "mask": True},
    "highest item": CONTAINER | {"env": "unload/HighestItem-v0"},
}


def few_walls(rng):
    """Loads that are unloaded before an episode of many picks ends."""
    return stack_load(rng, walls=1)


def metres(run) -> None:
    """A change: what is learned is how far a pick lifts."""
    run.reward = lambda picks, distances: distances


@contextmanager
def at_step(number: int, action: Callable[[], None]) -> Iterator[None]:
    """Do something right after a training step; they are counted from 1."""
    step, count = Training.step, itertools.count(1)

    def watched(run):
        step(run)
        if next(count) == number:
            action()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Training, "step", watched)
        yield


def interrupt() -> None:
    signal.raise_signal(signal.SIGINT)


def interrupt_run(
    config: TrainConfig, folder: Path, steps: int, number=signal.SIGINT, **given
) -> None:
    """Start a run and press Ctrl-C after some steps, or send another signal."""
    message = f"stopped after {4 * steps} picks; call train again with run_dir='.*{folder.name}'"
    stop, handler = at_step(steps, partial(signal.raise_signal, number)), signal.getsignal(number)
    with stop, pytest.raises(KeyboardInterrupt, match=message):
        train(config, folder, progress=False, **given)
    assert signal.getsignal(number) is handler


def kill_run(config: TrainConfig, folder: Path, picks: int) -> None:
    """Start a run in a fork of this process, which is killed at a point of its curve.

    It writes a checkpoint after each step.
    """

    def kill(point):
        if point["picks"] == picks:
            os.kill(os.getpid(), signal.SIGKILL)

    def run():
        torch.set_num_threads(1)  # OpenMP's threads do not live in a fork
        training.CHECKPOINT_INTERVAL = 0
        train(config, folder, progress=False, stack=few_walls, callback=kill, same_code=True)

    process = multiprocessing.get_context("fork").Process(target=run, daemon=True)
    process.start()
    process.join(timeout=100)  # s; a fork that hangs is a failure
    assert process.exitcode == -signal.SIGKILL


def content(folder: Path) -> tuple[bytes, pd.DataFrame]:
    """What a run leaves, but for the time of day."""
    curve = pd.read_csv(folder / "curve.csv").drop(columns="wall_time")
    return (folder / "policy.safetensors").read_bytes(), curve


def assert_same(one: Path, other: Path) -> None:
    (weights, curve), (other_weights, other_curve) = content(one), content(other)
    pd.testing.assert_frame_equal(curve, other_curve, check_exact=True)
    assert weights == other_weights


def make_batch(rng: np.random.Generator, size: int = 150, items: int = 20) -> dict:
    """Random arrays as those of a ``ReplayBuffer`` with next states."""
    masks = rng.integers(2, size=(size, items)).astype(bool)
    masks[:, 0] = True
    return {
        "observations": rng.uniform(-1, 1, (size, items, 3)).astype(np.float32),
        "actions": rng.integers(items, size=size),
        "rewards": rng.choice([-1.0, 1.0], size=size).astype(np.float32),
        "next_observations": rng.uniform(-1, 1, (size, items, 3)).astype(np.float32),
        "next_masks": masks,
        "terminations": rng.random(size) < 0.2,
    }


def without_next(batch: dict) -> dict:
    return {name: batch[name] for name in ("observations", "actions", "rewards")}


class HeightNetwork(torch.nn.Module):
    """Values each item by its z, times a weight."""

    def __init__(self, weight: float | torch.Tensor = 1.0) -> None:
        super().__init__()
        self.weight = torch.nn.Parameter(torch.as_tensor(weight))

    def forward(self, observations: torch.Tensor, present=None) -> torch.Tensor:
        return observations[..., 2] * self.weight


class Subclass(PEQNetwork):
    """Its weights would fit the package's network, too."""


def peq(n_features: int = 8, seed: int = 0) -> PEQNetwork:
    return PEQNetwork(n_features, torch.Generator().manual_seed(seed))


def weights(network: torch.nn.Module) -> list[torch.Tensor]:
    return [parameter.detach().clone() for parameter in network.parameters()]


def lowest(observations: np.ndarray, masks: np.ndarray, rng) -> np.ndarray:
    """A policy that goes for the lowest item, which has others on it."""
    return np.where(masks, observations[..., 2], np.inf).argmin(axis=1)
