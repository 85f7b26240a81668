"""The training loop: vector environment, replay, updates, curves, checkpoints (Sec. IV-B)."""

import json
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import NamedTuple

import gymnasium
import numpy as np
import pandas as pd
import torch
from gymnasium.vector import AutoresetMode
from tqdm import tqdm

from unload import files, task
from unload.agent import DQN, Greedy, load_policy, save_policy
from unload.config import ENVS, TrainConfig
from unload.network import PEQNetwork
from unload.replay import ReplayBuffer
from unload.substacks import Load


class TrainResult(NamedTuple):
    """What a training run leaves.

    Attributes:
        policy: the trained network, as a greedy policy.
        curve: one row per ``log_interval`` steps, means over it: ``picks`` so far,
            ``mean_reward``, ``success_rate`` (MSR of the exploring agent), ``loss`` (NaN
            before the first update), ``epsilon``, and ``wall_time`` in s since the epoch.
    """

    policy: Greedy
    curve: pd.DataFrame


CURVE_COLUMNS = ("picks", "mean_reward", "success_rate", "loss", "epsilon", "wall_time")


def train(
    config: TrainConfig,
    run_dir: str | Path,
    progress: bool = True,
    stack: Callable[[np.random.Generator], Load] | None = None,
) -> TrainResult:
    """Train an agent; go on where ``run_dir`` holds a checkpoint of the same configuration.

    A run that was interrupted and resumed gives the same weights and curves, bit by bit but
    for the wall times, as one that was not. Ctrl-C writes a checkpoint first. A finished
    run is not repeated.

    Args:
        config: what to train.
        run_dir: folder of the run: ``checkpoint.npz`` while it lasts, and at its end
            ``policy.safetensors``, ``curve.csv`` and ``config.json``.
        progress: show picks/s, MSR, loss and the time left.
        stack: makes the loads, see ``ContainerEnv``; the paper's if None. It is not part
            of the configuration: pass the same one to go on.

    Raises:
        TypeError: ``config`` is not a ``TrainConfig``.
        ValueError: ``run_dir`` is not a folder, or holds a run of another configuration
            or damaged files; ``stack`` is given for an environment without loads.
        KeyboardInterrupt: after Ctrl-C, naming the folder to go on from.
    """
    if not isinstance(config, TrainConfig):
        raise TypeError(f"config is {config!r}; expected an unload.TrainConfig")
    if stack is not None and config.env != ENVS[0]:
        raise ValueError(f"stack is given; expected None for env={config.env!r}")
    folder = Path(run_dir)
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"run_dir is {str(folder)!r}, a file; expected a folder")
    folder.mkdir(parents=True, exist_ok=True)
    if not (folder / "config.json").exists():
        _train(config, folder, progress, stack)
    _check_same(files.read_json(folder / "config.json"), config, folder)
    return TrainResult(
        load_policy(folder / "policy.safetensors"), pd.read_csv(folder / "curve.csv")
    )


def _train(config: TrainConfig, folder: Path, progress: bool, stack: Callable | None) -> None:
    run = _Run(config, folder, stack)
    try:
        run.go(progress)
    finally:
        run.envs.close()
    save_policy(
        Greedy(run.agent.network, config.equalize, config.ties), folder / "policy.safetensors"
    )
    curve = pd.DataFrame(run.curve, columns=CURVE_COLUMNS)
    files.write_text(folder / "curve.csv", curve.to_csv(index=False))
    files.write_json(folder / "config.json", asdict(config))  # last: it marks the run as finished
    run.checkpoint.unlink(missing_ok=True)


def _check_same(stored: dict, config: TrainConfig, folder: Path) -> None:
    """Raise unless a stored configuration is ``config``."""
    wanted = json.loads(json.dumps(asdict(config)))
    differing = [name for name in wanted if stored.get(name) != wanted[name]]
    if differing:
        details = ", ".join(f"{n} ({stored.get(n)!r}, not {wanted[n]!r})" for n in differing)
        raise ValueError(
            f"run_dir {str(folder)!r} holds a run of another configuration: {details}; "
            "expected the same one or an empty folder"
        )


@contextmanager
def _interrupt_later() -> Iterator[list[int]]:
    """Collect Ctrl-C in a list instead of raising, so that no step is left half done."""
    received: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield received  # only the main thread receives signals
        return
    previous = signal.signal(signal.SIGINT, lambda number, frame: received.append(number))
    try:
        yield received
    finally:
        signal.signal(signal.SIGINT, previous)


class _Run:
    """A training run in progress: everything a checkpoint must hold."""

    def __init__(self, config: TrainConfig, folder: Path, stack: Callable | None) -> None:
        self.config, self.folder = config, folder
        self.checkpoint = folder / "checkpoint.npz"
        env_seed, rng_seed, torch_seed = np.random.SeedSequence(config.seed).generate_state(3)
        self.rng = np.random.default_rng(rng_seed)
        weights = torch.Generator().manual_seed(int(torch_seed))
        self.agent = DQN(
            PEQNetwork(config.n_features, weights),
            config.learning_rate,
            config.gamma,
            config.beta,
        )
        size = min(config.replay_size, config.picks)
        self.replay = ReplayBuffer(size, task.N_VISIBLE, next_state=config.gamma > 0)
        container = {"physics": config.physics} if config.env == ENVS[0] else {}
        if stack is not None:
            container["stack"] = stack
        self.envs = gymnasium.make_vec(
            config.env,
            config.num_envs,
            vectorization_mode="sync",
            vector_kwargs={"autoreset_mode": AutoresetMode.SAME_STEP},
            equalize=config.equalize,
            ties=config.ties,
            max_picks=config.max_picks,
            **container,
        )
        self.picks = 0
        self.curve: list[tuple[float, ...]] = []
        self.rewards: list[float] = []  # since the last point of the curve
        self.losses: list[float] = []
        stored = self._read_checkpoint()
        self.observations, infos = self.envs.reset(seed=int(env_seed))
        self.masks = self._usable(infos["action_mask"])
        if stored is not None:
            self._restore(stored)

    def go(self, progress: bool) -> None:
        """Train to the end, with a checkpoint now and then and on Ctrl-C."""
        saved = time.monotonic()
        bar = tqdm(
            total=self.config.picks,
            initial=self.picks,
            unit="pick",
            unit_scale=True,
            mininterval=1.0,
            disable=not progress,
            ncols=100,
            file=sys.stdout,
        )
        with bar, _interrupt_later() as interrupts:
            while self.picks < self.config.picks:
                self._step()
                bar.update(self.config.num_envs)
                if not self.rewards:
                    _, _, msr, loss, *_ = self.curve[-1]
                    bar.set_postfix(MSR=f"{msr:.1%}", loss=f"{loss:.3f}", refresh=False)
                if interrupts or time.monotonic() - saved > self.config.checkpoint_interval:
                    self._save()
                    saved = time.monotonic()
                if interrupts:
                    raise KeyboardInterrupt(
                        f"stopped after {self.picks} picks; call train again with "
                        f"run_dir={str(self.folder)!r} to go on"
                    )

    def _step(self) -> None:
        """One pick in every environment, and the updates that follow it."""
        config = self.config
        epsilon = config.epsilon(self.picks)
        actions = self.agent.act(self.observations, self.masks, epsilon, self.rng)
        following, rewards, terminations, truncations, infos = self.envs.step(actions)
        batch = {"observations": self.observations, "actions": actions, "rewards": rewards}
        if config.gamma > 0:
            batch |= self._next_state(following, terminations, infos)
        self.replay.add(**batch)
        self.observations, self.masks = following, self._usable(infos["action_mask"])
        before, self.picks = self.picks, self.picks + config.num_envs
        self.rewards.append(float(np.mean(rewards)))
        if len(self.replay) >= min(config.batch_size, self.replay.size):
            for _ in range(config.gradient_steps):
                batch = self.replay.sample(config.batch_size, self.rng)
                self.losses.append(self.agent.update(batch))
        interval = config.target_update_interval
        if config.gamma > 0 and before // interval != self.picks // interval:
            self.agent.update_target()
        if len(self.rewards) == config.log_interval or self.picks == config.picks:
            mean_reward = float(np.mean(self.rewards))
            loss = float(np.mean(self.losses)) if self.losses else float("nan")
            self.curve.append(
                (self.picks, mean_reward, (mean_reward + 1) / 2, loss, epsilon, time.time())
            )
            self.rewards, self.losses = [], []

    def _usable(self, masks: np.ndarray) -> np.ndarray:
        """What the agent may choose from: the mask is part of training only if asked for."""
        return masks.astype(bool) if self.config.mask else np.ones(masks.shape, dtype=bool)

    def _next_state(self, observations, terminations, infos) -> dict[str, np.ndarray]:
        """What followed each pick; at an episode's end the last sight of it, not the reset's."""
        observations, masks = observations.copy(), infos["action_mask"].astype(bool)
        for env in np.flatnonzero(infos.get("_final_obs", [])):
            observations[env] = infos["final_obs"][env]
            masks[env] = infos["final_info"]["action_mask"][env]
        return {
            "next_observations": observations,
            "next_masks": masks,
            "terminations": terminations,
        }

    def _save(self) -> None:
        arrays = {f"agent.{name}": array for name, array in self.agent.state().items()}
        filled = len(self.replay)
        arrays |= {f"replay.{name}": a[:filled] for name, a in self.replay.arrays.items()}
        for number, env in enumerate(self.envs.envs):
            for name, array in env.unwrapped.get_state().items():
                arrays[f"env.{number}.{name}"] = array
        arrays |= {
            "observations": self.observations,
            "masks": self.masks,
            "curve": np.array(self.curve, dtype=np.float64).reshape(-1, len(CURVE_COLUMNS)),
            "rewards": np.array(self.rewards),
            "losses": np.array(self.losses),
            "total": np.array(self.replay.total),
            "picks": np.array(self.picks),
            "rng": np.array(json.dumps(self.rng.bit_generator.state)),
            "config": np.array(json.dumps(asdict(self.config))),
        }
        files.write_arrays(self.checkpoint, arrays)

    def _read_checkpoint(self) -> dict[str, np.ndarray] | None:
        if not self.checkpoint.exists():
            return None
        stored = files.read_arrays(self.checkpoint)
        if "config" not in stored:
            raise ValueError(f"{self.checkpoint} holds {sorted(stored)}; expected a checkpoint")
        _check_same(json.loads(str(stored["config"])), self.config, self.folder)
        return stored

    def _restore(self, stored: dict[str, np.ndarray]) -> None:
        def under(prefix: str) -> dict[str, np.ndarray]:
            return {k.removeprefix(prefix): v for k, v in stored.items() if k.startswith(prefix)}

        self.agent.load_state(under("agent."))
        for name, array in under("replay.").items():
            self.replay.arrays[name][: len(array)] = array
        self.replay.total = int(stored["total"])
        for number, env in enumerate(self.envs.envs):
            env.unwrapped.set_state(under(f"env.{number}."))
        self.observations, self.masks = stored["observations"], stored["masks"]
        self.curve = [(int(picks), *means) for picks, *means in stored["curve"].tolist()]
        self.rewards, self.losses = stored["rewards"].tolist(), stored["losses"].tolist()
        self.picks = int(stored["picks"])
        self.rng.bit_generator.state = json.loads(str(stored["rng"]))
