"""The training loop (Sec. II-B and IV-B): ε-greedy picks, replay, updates, learning curve."""

import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import TextIO

import numpy as np
import pandas as pd
import torch
from tqdm import tqdm

from unload import task
from unload.agent.checkpoint import RunFolder, TrainResult, settings_of
from unload.agent.config import ENVS, TrainConfig
from unload.agent.dqn import DQN
from unload.agent.greedy import Greedy
from unload.agent.identity import unchanged
from unload.agent.replay import ReplayBuffer
from unload.agent.rollout import Rollout
from unload.load.boxes import Load, check_stack
from unload.network.variants import NETWORKS
from unload.physics.table import shared_table
from unload.support import checks

CURVE_COLUMNS = (
    "picks", "mean_reward", "success_rate", "deadlocked", "loss", "epsilon", "wall_time"
)  # fmt: skip
CURVE_INTERVAL = 1.0  # seconds between two versions of it on disk
SUMS = ("picks", "rewards", "deadlocked", "updates", "losses")
# PyTorch draws first weights otherwise without these instructions; with either, all bits agree.
INSTRUCTIONS = ("AVX2", "AVX512")


class Curve:
    """The learning curve: points over every ``log_interval`` steps, and the sums since the last.

    Attributes:
        points: one tuple of ``CURVE_COLUMNS`` each, see ``TrainResult``.
        sums: by the names in ``SUMS``.
    """

    def __init__(self) -> None:
        self.points: list[tuple[float, ...]] = []
        self._start_point()

    def _start_point(self) -> None:
        self.sums = dict.fromkeys(SUMS, 0.0)

    def add(self, rewards: np.ndarray, deadlocked: np.ndarray, losses: Iterable[float]) -> None:
        """Count one step.

        Args:
            rewards: (num_envs,) of its picks.
            deadlocked: (num_envs,) bool, picks of items that had failed since the last success.
            losses: of its updates.
        """
        sums = self.sums
        sums["picks"] += len(rewards)
        sums["rewards"] += rewards.sum()
        sums["deadlocked"] += deadlocked.sum()
        for loss in losses:
            sums["losses"] += loss
            sums["updates"] += 1

    def end_point(self, picks: int, epsilon: float) -> None:
        """Add the point of the steps since the last one, after ``picks`` picks in all."""
        sums = self.sums
        mean_reward = sums["rewards"] / sums["picks"]
        loss = sums["losses"] / sums["updates"] if sums["updates"] else float("nan")
        self.points.append((
            picks, mean_reward, (mean_reward + 1) / 2, sums["deadlocked"] / sums["picks"],
            loss, epsilon, time.time(),
        ))  # fmt: skip
        self._start_point()

    def table(self) -> pd.DataFrame:
        """Return one row per point, with the columns ``CURVE_COLUMNS``."""
        return pd.DataFrame(self.points, columns=CURVE_COLUMNS)

    def state(self) -> dict[str, np.ndarray]:
        """Return what ``load_state`` needs to go on from here."""
        points = np.array(self.points, dtype=np.float64).reshape(-1, len(CURVE_COLUMNS))
        return {"points": points, "sums": np.array([self.sums[name] for name in SUMS])}

    def load_state(self, arrays: dict[str, np.ndarray]) -> None:
        """Go on from what ``state`` returned."""
        self.points = [(int(picks), *means) for picks, *means in arrays["points"].tolist()]
        self.sums = dict(zip(SUMS, arrays["sums"].tolist(), strict=True))


@cache  # once; Python's own filter forgets where another module changes filters
def warn_of_other_bits(instructions: str) -> None:
    """Warn where PyTorch draws other first weights from a seed than on most processors."""
    if instructions not in INSTRUCTIONS:
        warnings.warn(
            f"PyTorch uses {instructions} instructions of this processor; with the same seed a run "
            f"starts with other weights than where it uses {' or '.join(INSTRUCTIONS)}",
            stacklevel=3,
        )


class Training:
    """A training run in progress; ``unload.train`` also keeps it on disk.

    Args:
        config: of the run.
        stack: makes the loads, see ``unload.train``.
        change: is made at the end, see ``train_changed``.

    Attributes:
        rollout: the environments and the picks made in them.
        agent: the ``DQN``.
        replay: the picks that the agent learns from.
        curve: the learning curve so far.
        rng: draws exploration and batches.
    """

    def __init__(
        self,
        config: TrainConfig,
        stack: Callable | None = None,
        change: Callable[["Training"], None] = unchanged,
    ) -> None:
        self.config, self.settings = config, settings_of(config, stack, change)
        warn_of_other_bits(torch.backends.cpu.get_cpu_capability())
        _, rng_seed, weights_seed = config.seeds()
        self.rng = np.random.default_rng(rng_seed)
        generator = torch.Generator().manual_seed(weights_seed)
        network = NETWORKS[config.network](config.n_features, generator)
        self.agent = DQN(network, config.learning_rate, config.gamma, config.beta)
        self.replay = ReplayBuffer(
            min(config.replay_size, config.picks),
            task.N_VISIBLE,
            next_state=config.gamma > 0,
        )
        self.curve = Curve()
        self.rollout = Rollout(config, self.replay.size, stack)
        change(self)

    def step(self) -> None:
        """Pick once in every environment, and learn from the picks before.

        The update is begun before the picks, because the fused one can then be computed while
        the environments step; it never learns from the picks of its own step.
        """
        config, rollout = self.config, self.rollout
        enough = len(self.replay) >= min(config.batch_size, self.replay.size)
        updates = config.gradient_steps if enough else 0
        finish_update = self.start_update() if updates else None

        epsilon = config.epsilon(rollout.picks)
        actions = self.agent.choose(rollout.observations, rollout.allowed, epsilon, self.rng)
        deadlocked = rollout.deadlocked(actions)
        rewards, transitions = rollout.pick(actions)

        losses = [finish_update()] if updates else []
        for _ in range(1, updates):
            losses.append(self.start_update()())
        self.replay.add(**transitions)
        if config.gamma > 0 and rollout.picks % config.target_update_interval < config.num_envs:
            self.agent.update_target()

        self.curve.add(rewards, deadlocked, losses)
        if rollout.steps % config.log_interval == 0 or rollout.finished:
            self.curve.end_point(rollout.picks, epsilon)

    def start_update(self) -> Callable[[], float]:
        """Begin an update by a batch of the replay, see ``DQN.start_update``."""
        rows = self.replay.sample_rows(self.config.batch_size, self.rng)
        return self.agent.start_update(self.replay.arrays, rows)

    def policy(self) -> Greedy:
        """Return a copy of what has been learned so far, with a card."""
        config = self.config
        card = {
            "configuration": asdict(config),
            "change": self.settings["change"],
            "loads": self.settings["stack"] or "the paper's",
            "picks": self.rollout.picks,
            "msr": {"at the end of its training": self.curve.table()["success_rate"].iloc[-1]},
        }
        return Greedy(deepcopy(self.agent.network), config.equalize, config.ties, card)


def train(
    config: TrainConfig,
    run_dir: str | Path,
    progress: bool | TextIO = True,
    stack: Callable[[np.random.Generator], Load] | None = None,
    lifts: str | Path | None = None,
    callback: Callable[[dict[str, float]], None] | None = None,
) -> TrainResult:
    """Train an agent; go on where ``run_dir`` holds a checkpoint of the same configuration.

    A run that was interrupted and resumed gives the same weights and curves, bit by bit but
    for the wall times, as one that was not, and so does one that was killed: it goes on
    from its last checkpoint. Ctrl-C writes one first; pressed again, it stops at once. A
    finished run is not repeated. The same configuration gives the same bits on all x86-64
    processors with AVX2, with AVX-512 or without; a run on another one warns. The updates use
    ``torch.get_num_threads()`` threads; with the paper's network they go on while the
    environments step, and the result does not depend on the number of threads.

    Args:
        config: what to train.
        run_dir: folder of the run. Holds ``checkpoint.npz`` while it goes on and at the end
            ``policy.safetensors`` and ``config.json``. ``curve.csv`` grows from second to second:
            ``pandas.read_csv("runs/mine/curve.csv").plot("picks", ["success_rate", "loss"])``
            draws it at any time.
        progress: show a progress bar with speed, MSR and loss: on stdout, or in a text file.
        stack: makes the loads, as in ``ContainerEnv``; the paper's if None. It must make the
            same load whenever it is called with a generator in the same state.
        lifts: file in which the lifts that PyBullet has computed are kept, because loads whose
            boxes have other sizes need many of them. Read at the start if it exists, and filled
            up with each checkpoint and when the run ends, for whatever reason; runs, one after
            the other or side by side, may share it. It changes the speed of a run and nothing
            else; without it, a resumed run simulates the lifts of the repeated picks again.
        callback: is called at each point of the curve with that point, a dict by the columns of
            ``TrainResult.curve``: ``picks``, ``success_rate``, ``loss`` and so on. A run that is
            resumed calls it for new points only; an error in it ends the run.

    Returns:
        Policy and curve, read back from ``run_dir``.

    Raises:
        TypeError: an argument is not of the kind described.
        ValueError: ``run_dir`` is empty, or holds another configuration, another stack or a
            damaged file; ``stack`` or ``lifts`` is given for an environment without loads;
            ``stack`` does not make the same load again; ``lifts`` is empty or a folder, or its
            file is damaged, or of another physics.
        OSError: ``run_dir`` is a file, cannot be written, or holds a finished run of which a file
            is missing; ``lifts`` cannot be written.
        RuntimeError: another process is training in ``run_dir``; the message names it.
        FloatingPointError: the loss or a weight is no longer finite; the message names the
            pick, and the last checkpoint, if there is one, is kept.
        KeyboardInterrupt: after Ctrl-C, naming the folder to go on from.
        Exception: what ``callback`` raises, after a checkpoint, or ``stack``, where the run goes
            on from the last checkpoint.
    """
    return train_changed(config, run_dir, unchanged, progress, stack, lifts, callback)


def train_changed(
    config: TrainConfig,
    run_dir: str | Path,
    change: Callable[[Training], None],
    progress: bool | TextIO = True,
    stack: Callable[[np.random.Generator], Load] | None = None,
    lifts: str | Path | None = None,
    callback: Callable[[dict[str, float]], None] | None = None,
) -> TrainResult:
    """``train`` with something changed that no ``TrainConfig`` offers, for an experiment.

    Args:
        config, run_dir, progress, stack, lifts, callback: see ``train``.
        change: is called with the ``Training`` before its first pick, also where a run is
            resumed, and may replace methods of its parts, such as ``run.replay.add``. What it
            does to a pick may depend on the configuration and on how many picks were made before
            (``run.replay.total``), but on nothing else; otherwise a resumed run would differ.

    Raises:
        As ``train``; also where ``run_dir`` holds a run with another change.
    """
    if not isinstance(config, TrainConfig):
        raise TypeError(f"config is {config!r}; expected an unload.TrainConfig")
    if not isinstance(progress, bool) and not hasattr(progress, "write"):
        raise TypeError(f"progress is {progress!r}; expected True, False or a text file")
    if callback is not None and not callable(callback):
        raise TypeError(f"callback is {callback!r}; expected a function of a dict")
    for name, value in (("stack", stack), ("lifts", lifts)):
        if value is not None and config.env != ENVS[0]:
            raise ValueError(f"{name} is given; expected None for env={config.env!r}")
    if stack is not None:
        check_stack(stack)
    if lifts is not None:
        checks.file("lifts", lifts)

    def keep_lifts() -> None:
        try:
            if lifts is not None:
                shared_table().exchange(lifts)
        except ValueError as error:
            raise ValueError(f"lifts: {error}") from error

    folder = RunFolder(run_dir)
    if folder.finished:  # to be read only, perhaps where nothing can be written
        return folder.result(config, stack, change)
    keep_lifts()
    with folder.locked(), deferred_interrupts() as interrupts:
        if not folder.finished:  # by another process meanwhile
            run = Training(config, stack, change)
            try:
                _go(run, folder, keep_lifts, callback, progress, interrupts)
            finally:
                run.rollout.close()
                keep_lifts()
        return folder.result(config, stack, change)


def _go(
    run: Training,
    folder: RunFolder,
    keep_lifts: Callable[[], None],
    callback: Callable[[dict[str, float]], None] | None,
    progress: bool | TextIO,
    interrupts: list[int],
) -> None:
    """Train to the end, with a checkpoint now and then and on Ctrl-C."""
    config, rollout = run.config, run.rollout

    def stop_if_interrupted(picks: int) -> None:
        if interrupts:
            raise KeyboardInterrupt(
                f"stopped after {picks} picks; call train again with "
                f"run_dir={str(folder.path)!r} to go on"
            )

    first_shown = rollout.digest()
    repeated = folder.restore(run)
    next(repeated, None)  # its first step says where the bar begins
    with _progress_bar(rollout.picks, config.picks, progress) as bar:
        for picks in repeated:
            stop_if_interrupted(picks)
            bar.update(config.num_envs)
        saved, shown = time.monotonic(), 0.0
        while not rollout.finished:
            try:
                run.step()
                due = interrupts or time.monotonic() - saved > config.checkpoint_interval
                if due or rollout.finished:
                    run.agent.check_finite()
            except FloatingPointError as error:
                raise FloatingPointError(
                    f"after {rollout.picks} picks: {error}; the last checkpoint, if any, is kept"
                ) from error
            if due:
                folder.save(run)
                keep_lifts()
                saved = time.monotonic()
            bar.update(config.num_envs)
            if not run.curve.sums["picks"]:
                point = dict(zip(CURVE_COLUMNS, run.curve.points[-1]))
                msr, loss = point["success_rate"], point["loss"]
                bar.set_postfix(MSR=f"{msr:.1%}", loss=f"{loss:.3f}", refresh=False)
                if time.monotonic() - shown > CURVE_INTERVAL:
                    folder.save_curve(run)
                    shown = time.monotonic()
                try:
                    if callback is not None:
                        callback(point)
                except Exception:  # the step is complete
                    run.agent.check_finite()
                    folder.save(run)
                    raise
            if due:  # and therefore saved
                stop_if_interrupted(rollout.picks)
    folder.finish(run, first_shown)


@contextmanager
def deferred_interrupts() -> Iterator[list[int]]:
    """Note the first Ctrl-C of a run instead of raising; the second one stops at once.

    Yields:
        The signals received so far. The caller polls them and stops at a safe point.

    Raises:
        KeyboardInterrupt: at the second Ctrl-C, or at the end if nobody has stopped since the
            first one.
    """
    received: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield received  # only the main thread receives signals
        return

    def receive(number: int, frame: object) -> None:
        received.append(number)
        if len(received) > 1:
            raise KeyboardInterrupt

    previous = signal.signal(signal.SIGINT, receive)
    try:
        yield received
    finally:
        signal.signal(signal.SIGINT, previous)
    if received:
        raise KeyboardInterrupt


def _progress_bar(picks: int, total: int, progress: bool | TextIO) -> tqdm:
    return tqdm(
        total=total,
        initial=picks,
        unit="pick",
        unit_scale=True,
        mininterval=1.0,
        disable=not progress,
        ncols=100,
        file=sys.stdout if progress is True else progress,
    )
