"""The training loop: vector environment, replay, updates, curves, checkpoints (Sec. IV-B).

A checkpoint does not hold the replay memory, which is 1.6 GB in the paper's configuration.
The environments are deterministic, so it holds their state at the start of the oldest
episode that the memory reaches back to, and the picks since: repeating these fills the
memory again, pick by pick as it was.
"""

import json
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import asdict
from hashlib import blake2b
from pathlib import Path
from typing import NamedTuple

import gymnasium
import numpy as np
import pandas as pd
import torch
from tqdm import tqdm

from unload import task
from unload.agent.config import ENVS, TrainConfig
from unload.agent.dqn import DQN
from unload.agent.greedy import Greedy
from unload.agent.replay import ReplayBuffer
from unload.agent.weights import load_policy, save_policy
from unload.load.boxes import Load
from unload.network.variants import NETWORKS
from unload.support import files


class TrainResult(NamedTuple):
    """What a training run leaves.

    Attributes:
        policy: the trained network, as a greedy policy.
        curve: one row per ``log_interval`` steps, means over it: ``picks`` so far,
            ``mean_reward``, ``success_rate`` (MSR of the exploring agent), ``deadlocked``
            (share of picks whose item had already failed since the last success), ``loss``
            (NaN before the first update), ``epsilon``, and ``wall_time`` in s since the epoch.
    """

    policy: Greedy
    curve: pd.DataFrame


CURVE_COLUMNS = (
    "picks", "mean_reward", "success_rate", "deadlocked", "loss", "epsilon", "wall_time"
)  # fmt: skip
FORMAT = 3  # of the checkpoints


def train(
    config: TrainConfig,
    run_dir: str | Path,
    progress: bool = True,
    stack: Callable[[np.random.Generator], Load] | None = None,
) -> TrainResult:
    """Train an agent; go on where ``run_dir`` holds a checkpoint of the same configuration.

    A run that was interrupted and resumed gives the same weights and curves, bit by bit but
    for the wall times, as one that was not, and so does one that was killed: it goes on
    from its last checkpoint. Ctrl-C writes one first; pressed again, it stops at once. A
    finished run is not repeated. The updates use ``torch.get_num_threads()`` threads; with
    the paper's network they go on while the environments step, and the result does not
    depend on the number of threads.

    Args:
        config: what to train.
        run_dir: folder of the run: ``checkpoint.npz`` while it lasts, and at its end
            ``policy.safetensors``, ``curve.csv`` and ``config.json``. ``config.snapshots``
            policies are kept there as ``snapshots/<picks>.safetensors``.
        progress: show picks/s, MSR, loss and the time left.
        stack: makes the loads, see ``ContainerEnv``; the paper's if None. It is not part
            of the configuration: pass the same one to go on, or to read a finished run.

    Raises:
        TypeError: ``config`` is not a ``TrainConfig``.
        ValueError: ``run_dir`` is not a folder, or holds a run of another configuration
            or damaged files; ``stack`` is given for an environment without loads, or is
            not the one that the run was started with.
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
    stored = files.read_json(folder / "config.json")
    loads = stored.pop("first_loads", None)
    _check_same(stored, config, folder)
    if loads != _first_loads(config, stack):
        raise ValueError(
            f"run_dir {str(folder)!r} holds a run on other loads; expected the stack that it was "
            "trained with, or an empty folder"
        )
    for leftover in folder.glob("checkpoint.npz*"):
        leftover.unlink()
    return TrainResult(
        load_policy(folder / "policy.safetensors"), pd.read_csv(folder / "curve.csv")
    )


def _train(config: TrainConfig, folder: Path, progress: bool, stack: Callable | None) -> None:
    with _interrupt_later() as interrupts:
        run = _Run(config, folder, stack, interrupts)
        try:
            run.restore()
            run.go(progress)
        finally:
            run.envs.close()
        save_policy(run.policy(), folder / "policy.safetensors")
        curve = pd.DataFrame(run.curve, columns=CURVE_COLUMNS)
        files.write_text(folder / "curve.csv", curve.to_csv(index=False))
        # Last: it marks the run as finished.
        finished = asdict(config) | {"first_loads": _first_loads(config, stack)}
        files.write_json(folder / "config.json", finished)


def _seeds(config: TrainConfig) -> list[int]:
    """Of the environments, of exploration and replay, of the weights.

    The key keeps the loads apart from those that ``evaluate`` draws with the same seed.
    """
    return np.random.SeedSequence(config.seed, spawn_key=(1,)).generate_state(3).tolist()


def _environments(config: TrainConfig, stack: Callable | None) -> gymnasium.vector.VectorEnv:
    return gymnasium.make_vec(
        config.env,
        config.num_envs,
        equalize=config.equalize,
        ties=config.ties,
        max_picks=config.max_picks,
        **({} if stack is None else {"stack": stack}),
    )


def _first_loads(config: TrainConfig, stack: Callable | None) -> str:
    """Tells apart what a run is trained on: a digest of what it sees first."""
    envs = _environments(config, stack)
    try:
        observations, infos = envs.reset(seed=_seeds(config)[0])
    finally:
        envs.close()
    return _digest(observations, infos["action_mask"])


def _digest(observations: np.ndarray, masks: np.ndarray) -> str:
    """Tells apart what environments show."""
    return blake2b(observations.tobytes() + masks.tobytes(), digest_size=16).hexdigest()


def _check_same(stored: dict, config: TrainConfig, folder: Path) -> None:
    """Raise unless a stored configuration is ``config``."""
    wanted = json.loads(json.dumps(asdict(config)))
    # How often it is saved changes nothing in a run.
    names = [name for name in wanted | stored if name != "checkpoint_interval"]
    differing = [name for name in names if stored.get(name) != wanted.get(name)]
    if differing:
        details = ", ".join(f"{n} ({stored.get(n)!r}, not {wanted.get(n)!r})" for n in differing)
        raise ValueError(
            f"run_dir {str(folder)!r} holds a run of another configuration: {details}; "
            "expected the same one or an empty folder"
        )


@contextmanager
def _interrupt_later() -> Iterator[list[int]]:
    """Collect the first Ctrl-C in a list instead of raising: no step is left half done."""
    received: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield received  # only the main thread receives signals
        return

    def receive(number: int, frame: object) -> None:
        if received:
            signal.default_int_handler(number, frame)
        received.append(number)

    previous = signal.signal(signal.SIGINT, receive)
    try:
        yield received
    finally:
        signal.signal(signal.SIGINT, previous)


class _Run:
    """A training run in progress."""

    def __init__(
        self, config: TrainConfig, folder: Path, stack: Callable | None, interrupts: list[int]
    ) -> None:
        self.config, self.folder, self.interrupts = config, folder, interrupts
        self.checkpoint = folder / "checkpoint.npz"
        env_seed, rng_seed, torch_seed = _seeds(config)
        self.rng = np.random.default_rng(rng_seed)
        weights = torch.Generator().manual_seed(torch_seed)
        self.agent = DQN(
            NETWORKS[config.network](config.n_features, weights),
            config.learning_rate,
            config.gamma,
            config.beta,
        )
        size = min(config.replay_size, config.picks)
        self.replay = ReplayBuffer(size, task.N_VISIBLE, next_state=config.gamma > 0)
        self.curve: list[tuple[float, ...]] = []
        self.sums = self._no_sums()
        # Every pick of the run, (steps, num_envs); a row of the observation fits a byte.
        shape = (config.picks // config.num_envs, config.num_envs)
        self.actions = np.empty(shape, np.uint8)
        self.steps = 0  # made so far
        self.envs = _environments(config, stack)
        self._see(*self.envs.reset(seed=env_seed))
        # Of the episodes that the replay memory reaches back to: first step, state there.
        self.starts = deque([(0, self.envs.get_state())])

    def _see(self, observations: np.ndarray, infos: dict[str, np.ndarray]) -> None:
        """Take what ``reset`` or ``step`` of the environments shows and tells."""
        self.observations, self.masks = observations, infos["action_mask"]
        # Which items have failed is part of training's choices only if asked for.
        self.allowed = infos["action_mask" if self.config.mask else "item_mask"].astype(bool)

    @property
    def picks(self) -> int:
        return self.steps * self.config.num_envs

    def policy(self) -> Greedy:
        """What has been learned so far, a copy."""
        return Greedy(deepcopy(self.agent.network), self.config.equalize, self.config.ties)

    @staticmethod
    def _no_sums() -> dict[str, float]:
        """Sums since the last point of the curve."""
        return dict.fromkeys(("picks", "rewards", "deadlocked", "updates", "losses"), 0.0)

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
        with bar:
            while self.steps < len(self.actions):
                self._step()
                bar.update(self.config.num_envs)
                if not self.sums["picks"]:
                    _, _, msr, _, loss, *_ = self.curve[-1]
                    bar.set_postfix(MSR=f"{msr:.1%}", loss=f"{loss:.3f}", refresh=False)
                if self.interrupts or time.monotonic() - saved > self.config.checkpoint_interval:
                    self._save()
                    saved = time.monotonic()
                self._check_interrupts(self.picks)

    def _check_interrupts(self, picks: int) -> None:
        if self.interrupts:
            raise KeyboardInterrupt(
                f"stopped after {picks} picks; call train again with "
                f"run_dir={str(self.folder)!r} to go on"
            )

    def _step(self) -> None:
        """One pick in every environment; meanwhile the agent learns from those before."""
        config = self.config
        enough = len(self.replay) >= min(config.batch_size, self.replay.size)
        learns = enough and config.gradient_steps > 0
        complete = self._start_update() if learns else None
        epsilon = config.epsilon(self.picks)
        actions = self.agent.choose(self.observations, self.allowed, epsilon, self.rng)
        failed_before = self.masks[np.arange(config.num_envs), actions] == 0
        rewards, picks = self._pick(actions)
        sums = self.sums
        sums["picks"] += config.num_envs
        sums["rewards"] += rewards.sum()
        sums["deadlocked"] += failed_before.sum()
        if learns:
            sums["losses"] += complete()
            for _ in range(config.gradient_steps - 1):
                sums["losses"] += self._start_update()()
            sums["updates"] += config.gradient_steps
        self.replay.add(**picks)
        interval = config.target_update_interval
        if config.gamma > 0 and self.picks % interval < config.num_envs:
            self.agent.update_target()
        if self.steps % config.log_interval == 0 or self.steps == len(self.actions):
            mean_reward = sums["rewards"] / sums["picks"]
            loss = sums["losses"] / sums["updates"] if sums["updates"] else float("nan")
            self.curve.append((
                self.picks, mean_reward, (mean_reward + 1) / 2,
                sums["deadlocked"] / sums["picks"], loss, epsilon, time.time(),
            ))  # fmt: skip
            self.sums = self._no_sums()
        steps, snapshots = len(self.actions), config.snapshots
        if self.steps * snapshots // steps > (self.steps - 1) * snapshots // steps:
            save_policy(self.policy(), self.folder / f"snapshots/{self.picks:09d}.safetensors")

    def _start_update(self) -> Callable[[], float]:
        """Begin an update; what completes it returns the loss."""
        rows = self.replay.sample_rows(self.config.batch_size, self.rng)
        return self.agent.start_update(self.replay.arrays, rows)

    def _pick(self, actions: np.ndarray) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Pick in every environment; the rewards, and what to remember."""
        following, rewards, terminations, _, infos = self.envs.step(actions)
        picks = {
            "observations": self.observations,
            "actions": actions,
            "rewards": self._shaped(rewards, actions),
        }
        if self.config.gamma > 0:
            picks |= self._next_state(following, terminations, infos)
        self.actions[self.steps] = actions
        self.steps += 1
        self._see(following, infos)
        if self.steps % self.config.max_picks == 0:  # whole episodes, unless a container is empty
            self.starts.append((self.steps, self.envs.get_state()))
            while (self.steps - self.starts[1][0]) * self.config.num_envs >= self.replay.size:
                self.starts.popleft()
        return rewards, picks

    def _shaped(self, rewards: np.ndarray, actions: np.ndarray) -> np.ndarray:
        """What is learned from: a failed pick is the less bad, the higher its item is seen."""
        if not self.config.height_reward:
            return rewards
        heights = (self.observations[np.arange(len(actions)), actions, 2] + 1) / 2  # in [0, 1]
        return np.where(rewards < 0, rewards + self.config.height_reward * heights, rewards)

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
        """Write a checkpoint."""
        start, state = self.starts[0]
        arrays = {f"agent.{name}": array for name, array in self.agent.state().items()}
        arrays |= {f"start.{name}": array for name, array in state.items()}
        arrays |= {f"sums.{name}": np.array(value) for name, value in self.sums.items()}
        arrays |= {
            "format": np.array(FORMAT),
            "config": np.array(json.dumps(asdict(self.config))),
            "rng": np.array(json.dumps(self.rng.bit_generator.state)),
            "curve": np.array(self.curve, dtype=np.float64).reshape(-1, len(CURVE_COLUMNS)),
            "start": np.array(start),
            "actions": self.actions[start : self.steps],
            "digest": np.array(_digest(self.observations, self.masks)),
        }
        files.write_arrays(self.checkpoint, arrays)

    def restore(self) -> None:
        """Go on from the checkpoint, if there is one."""
        if not self.checkpoint.exists():
            return
        stored = files.read_arrays(self.checkpoint)
        if "config" not in stored:
            raise ValueError(f"{self.checkpoint} holds {sorted(stored)}; expected a checkpoint")
        if stored.get("format") != FORMAT:
            raise ValueError(
                f"{self.checkpoint} was written by another version of unload; expected format "
                f"{FORMAT}. Remove it to start anew, or go on with that version"
            )
        _check_same(json.loads(str(stored["config"])), self.config, self.folder)

        def under(prefix: str) -> dict[str, np.ndarray]:
            return {k.removeprefix(prefix): v for k, v in stored.items() if k.startswith(prefix)}

        self.agent.load_state(under("agent."))
        self.sums = {name: value.item() for name, value in under("sums.").items()}
        self.curve = [(int(picks), *means) for picks, *means in stored["curve"].tolist()]
        self.rng.bit_generator.state = json.loads(str(stored["rng"]))
        self.steps = int(stored["start"])
        self.replay.total = self.picks
        self.starts = deque([(self.steps, under("start."))])
        self._see(*self.envs.set_state(under("start.")))
        picks = self.picks + stored["actions"].size
        for actions in stored["actions"]:
            _, remembered = self._pick(actions.astype(np.int64))
            self.replay.add(**remembered)
            self._check_interrupts(picks)
        if _digest(self.observations, self.masks) != stored["digest"]:
            raise ValueError(
                f"{self.checkpoint}: its picks lead to other observations here; expected the "
                "same stack and version of unload as when it was written"
            )
