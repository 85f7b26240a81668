"""The training loop (Sec. II-B and IV-B): ε-greedy picks, replay, updates, learning curve."""

import json
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import NamedTuple, TextIO

import numpy as np
import pandas as pd
import torch
from tqdm import tqdm

from unload.agent.checkpoint import RunFolder, TrainResult, settings_of
from unload.agent.config import ENVS, TrainConfig
from unload.agent.dqn import DQN
from unload.agent.greedy import Greedy
from unload.agent.identity import unchanged
from unload.agent.learner import flat, grouped
from unload.agent.replay import ReplayBuffer
from unload.agent.rollout import Rollout
from unload.load.boxes import Load, check_stack
from unload.network.variants import make_network
from unload.physics.table import shared_table
from unload.support import checks

CURVE_INTERVAL = 1.0  # seconds between two versions of it on disk
SUMS = ("picks", "rewards", "deadlocked", "updates", "losses")
# PyTorch draws first weights otherwise without these instructions; with either, all bits agree.
INSTRUCTIONS = ("AVX2", "AVX512")


class Point(NamedTuple):
    """A point of the learning curve, see ``TrainResult``."""

    picks: int
    mean_reward: float
    success_rate: float
    deadlocked: float
    loss: float
    epsilon: float
    wall_time: float


class Curve:
    """The learning curve: points over every ``log_interval`` steps, and the sums since the last.

    Attributes:
        points: so far.
        sums: since the last point, by the names in ``SUMS``.
    """

    def __init__(self) -> None:
        self.points: list[Point] = []
        self.sums = dict.fromkeys(SUMS, 0.0)

    def add(self, rewards: np.ndarray, deadlocked: np.ndarray, losses: Iterable[float]) -> None:
        """Count the picks of one step, (num_envs,) arrays, and the losses of its updates."""
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
        reward, deadlocked = sums["rewards"] / sums["picks"], sums["deadlocked"] / sums["picks"]
        loss = sums["losses"] / sums["updates"] if sums["updates"] else float("nan")
        self.points.append(
            Point(picks, reward, (reward + 1) / 2, deadlocked, loss, epsilon, time.time())
        )
        self.sums = dict.fromkeys(SUMS, 0.0)

    def table(self) -> pd.DataFrame:
        """Return one row per point."""
        return pd.DataFrame(self.points, columns=Point._fields)


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
        change: is made at the end, see ``train``.

    Attributes:
        settings: what the run is, as JSON can hold it.
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
        network = make_network(config.network, config.n_features, generator)
        self.agent = DQN(network, config.learning_rate, config.gamma, config.beta)
        self.replay = ReplayBuffer.of(config)
        self.curve = Curve()
        self.rollout = Rollout(config, stack)
        change(self)

    def step(self) -> None:
        """Pick once in every environment, and learn from the picks before."""
        config, rollout = self.config, self.rollout

        # The update is begun before the picks, because the fused one can then be computed while
        # the environments step; it never learns from the picks of its own step.
        enough = len(self.replay) >= min(config.batch_size, self.replay.size)
        updates = config.gradient_steps if enough else 0
        finish_update = self.start_update() if updates else None

        # Whether a pick is deadlocked must be asked before it changes the masks.
        epsilon = config.epsilon(rollout.picks)
        actions = self.agent.choose(rollout.observations, rollout.allowed, epsilon, self.rng)
        deadlocked = rollout.deadlocked(actions)
        picks, distances = rollout.pick(actions)

        # Further updates come one after the other, because each needs the weights of the last.
        losses = [finish_update()] if updates else []
        for _ in range(1, updates):
            losses.append(self.start_update()())

        # The curve shows the environment's rewards, whatever is learned from.
        self.curve.add(picks["rewards"], deadlocked, losses)
        self.replay.add(**picks | {"rewards": self.reward(picks, distances)})
        if config.gamma > 0 and rollout.picks % config.target_update_interval < config.num_envs:
            self.agent.update_target()
        if rollout.steps % config.log_interval == 0 or rollout.finished:
            self.curve.end_point(rollout.picks, epsilon)

    def reward(self, picks: dict[str, np.ndarray], distances: np.ndarray) -> np.ndarray:
        """Return what picks are worth in learning; a change may put another function here.

        Args:
            picks: of a step, as ``ReplayBuffer`` holds them.
            distances: see ``Rollout.pick``.
        """
        return picks["rewards"]

    def start_update(self) -> Callable[[], float]:
        """Begin an update by a batch of the replay, see ``DQN.start_update``."""
        rows = self.replay.sample_rows(self.config.batch_size, self.rng)
        return self.agent.start_update(self.replay.arrays, rows)

    def policy(self) -> Greedy:
        """Return a copy of what has been learned so far, with a card."""
        config, settings = self.config, dict(self.settings)
        card = {
            "change": settings.pop("change"),
            "loads": settings.pop("stack") or "the paper's",
            "configuration": settings,
            "picks": self.rollout.picks,
            "msr": {"at the end of its training": self.curve.points[-1].success_rate},
        }
        return Greedy(deepcopy(self.agent.network), config.equalize, config.ties, card)

    def state(self) -> dict[str, np.ndarray]:
        """Return what ``load_state`` needs to go on from here; the replay memory is not copied."""
        parts = {
            "agent": self.agent.state(),
            "envs": self.rollout.envs.state(),
            "replay": self.replay.state(),
        }
        rest = {
            "steps": self.rollout.steps,
            "points": self.curve.points,
            "sums": self.curve.sums,
            "rng": self.rng.bit_generator.state,
        }
        return flat(parts) | {"rest": np.array(json.dumps(rest))}

    def load_state(self, arrays: dict[str, np.ndarray]) -> None:
        """Go on from what ``state`` returned."""
        parts = grouped(arrays)
        rest = json.loads(str(arrays["rest"]))
        self.agent.load_state(parts["agent"])
        self.replay.load_state(parts["replay"])
        self.rollout.resume(rest["steps"], parts["envs"])
        self.curve.points, self.curve.sums = [Point(*each) for each in rest["points"]], rest["sums"]
        self.rng.bit_generator.state = rest["rng"]


def train(
    config: TrainConfig,
    run_dir: str | Path,
    progress: bool | TextIO = True,
    stack: Callable[[np.random.Generator], Load] | None = None,
    lifts: str | Path | None = None,
    callback: Callable[[dict[str, float]], bool | None] | None = None,
    change: Callable[[Training], None] = unchanged,
) -> TrainResult:
    """Train an agent; go on where ``run_dir`` holds a checkpoint of the same configuration.

    A run that was interrupted and resumed gives the same weights and curves, bit by bit but
    for the wall times, as one that was not, and so does one that was killed: it goes on
    from its last checkpoint. A finished run is not repeated. The same configuration gives the
    same bits on all x86-64 processors with AVX2, with AVX-512 or without; a run on another one
    warns. The updates use ``torch.get_num_threads()`` threads; with the paper's network they go
    on while the environments step, and the result does not depend on the number of threads. With
    another network it may, because PyTorch then adds up in another order (``"attention"`` does).

    A checkpoint is written every ``config.checkpoint_interval`` seconds, on Ctrl-C, which pressed
    again stops at once, and after an error in ``callback``. It holds all that the run is, also
    its replay memory, 1.6 GB with the paper's configuration and twice that with gamma > 0, and
    needs twice that room on the disk while a new one replaces it. The end of the run removes it.

    What no ``TrainConfig`` offers is changed by ``change``. This agent learns that a pick is worth
    the metres by which it lifts::

        def metres(run):
            run.reward = lambda picks, distances: distances

        train(TrainConfig(), "runs/metres", change=metres)

    Args:
        config: what to train.
        run_dir: folder of the run. Holds ``checkpoint.npz`` while it goes on and at the end
            ``policy.safetensors`` and ``config.json``. ``curve.csv`` grows from second to second:
            ``pandas.read_csv("runs/mine/curve.csv").plot("picks", ["success_rate", "loss"])``
            draws it at any time.
        progress: show a progress bar with speed, MSR and loss: on stdout, or in a text file.
        stack: makes the loads, as in ``ContainerEnv``; the paper's if None. What it makes must
            depend on its generator alone; otherwise a resumed run would differ.
        lifts: file in which the lifts that PyBullet has computed are kept, because loads whose
            boxes have other sizes need many of them. Read at the start if it exists, and filled
            up with each checkpoint and when the run ends, for whatever reason; runs, one after
            the other or side by side, may share it. It changes the speed of a run and nothing
            else.
        callback: is called at each point of the curve with that point, a dict by the columns of
            ``TrainResult.curve``: ``picks``, ``success_rate``, ``loss`` and so on. A run that is
            resumed calls it for new points only; an error in it ends the run. So does False, with
            a policy and a curve: what has been learned until then is the run's result.
        change: is called with the ``Training`` before its first pick, also where a run is
            resumed, and may replace methods of its parts, such as ``run.replay.add``. What it
            does to a pick may depend on the configuration and on how many picks were made before
            (``run.replay.total``), but on nothing else; otherwise a resumed run would differ.

    Returns:
        Policy and curve, read back from ``run_dir``.

    Raises:
        TypeError: an argument is not of the kind described.
        ValueError: ``run_dir`` is empty, or holds another configuration, stack or change or a
            damaged file; ``stack`` or ``lifts`` is given for an environment without loads;
            ``lifts`` is empty or a folder, or its file is damaged, or of another physics.
        OSError: ``run_dir`` is a file, cannot be written, has no room for checkpoints, or holds a
            finished run of which a file is missing; ``lifts`` cannot be written.
        RuntimeError: another process is training in ``run_dir``; the message names it.
        FloatingPointError: the loss or a weight is no longer finite; the message names the
            pick, and the last checkpoint, if there is one, is kept.
        KeyboardInterrupt: after Ctrl-C, naming the folder to go on from.
        BaseException: what ``callback`` raises, after a checkpoint, or ``stack``, where the run
            goes on from the last checkpoint.
    """
    checks.instance("config", config, TrainConfig, "an unload.TrainConfig")
    if not isinstance(progress, bool) and not hasattr(progress, "write"):
        raise TypeError(f"progress is {progress!r}; expected True, False or a text file")
    if callback is not None and not callable(callback):
        raise TypeError(f"callback is {callback!r}; expected a function of a dict")
    if not callable(change):
        raise TypeError(f"change is {change!r}; expected a function of a Training")
    for name, value in (("stack", stack), ("lifts", lifts)):
        if value is not None and config.env == ENVS[1]:
            raise ValueError(f"{name} is given; expected None for env={config.env!r}")
    if stack is not None:
        check_stack(stack)
    table = None if lifts is None else checks.file("lifts", lifts).absolute()

    def keep_lifts() -> None:
        try:
            if table is not None:
                shared_table().exchange(table)
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
                folder.check_room(run)
                folder.restore(run)
                _go(run, folder, keep_lifts, callback, progress, interrupts)
                folder.finish(run)
            finally:
                run.rollout.close()
                keep_lifts()
        return folder.result(config, stack, change)


def _go(
    run: Training,
    folder: RunFolder,
    keep_lifts: Callable[[], None],
    callback: Callable[[dict[str, float]], bool | None] | None,
    progress: bool | TextIO,
    interrupts: list[int],
) -> None:
    """Train to the end, with a checkpoint now and then, and one where the run is stopped."""
    config, rollout = run.config, run.rollout
    saved, shown = time.monotonic(), 0.0
    bar = tqdm(
        total=config.picks, initial=rollout.picks, unit="pick", unit_scale=True, mininterval=1.0,
        disable=not progress, ncols=100, file=sys.stdout if progress is True else progress,
    )  # fmt: skip
    with bar:
        while not rollout.finished:
            # An error in a step leaves it half done: nothing can be saved then.
            try:
                run.step()
                due = time.monotonic() - saved > config.checkpoint_interval
                if due or rollout.finished:
                    run.agent.check_finite()
            except FloatingPointError as error:
                raise FloatingPointError(
                    f"after {rollout.picks} picks: {error}; the last checkpoint, if any, is kept"
                ) from error
            if due and not rollout.finished:
                folder.save(run)
                keep_lifts()
                saved = time.monotonic()

            # From here on the step is whole, and the run can go on after whatever is raised.
            try:
                bar.update(config.num_envs)
                if not run.curve.sums["picks"]:
                    point = run.curve.points[-1]
                    bar.set_postfix(
                        MSR=f"{point.success_rate:.1%}", loss=f"{point.loss:.3f}", refresh=False
                    )
                    if time.monotonic() - shown > CURVE_INTERVAL:
                        folder.save_curve(run)
                        shown = time.monotonic()
                    answer = None if callback is None else callback(point._asdict())
                    if isinstance(answer, (bool, np.bool_)) and not answer:
                        run.agent.check_finite()
                        return
                if interrupts:
                    raise KeyboardInterrupt(
                        f"stopped after {rollout.picks} picks; call train again with "
                        f"run_dir={str(folder.path)!r} to go on"
                    )
            except BaseException:
                if len(interrupts) < 2:  # the second Ctrl-C stops at once
                    run.agent.check_finite()
                    folder.save(run)
                raise


@contextmanager
def deferred_interrupts() -> Iterator[list[int]]:
    """Note the first Ctrl-C, so that the run stops at a safe point; the second one stops at once.

    Yields:
        The signals received so far. If the block ends after one, KeyboardInterrupt is raised.
    """
    received: list[int] = []

    def receive(number: int, frame: object) -> None:
        received.append(number)
        if len(received) > 1:
            raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield received  # only the main thread receives signals
        return
    previous = signal.signal(signal.SIGINT, receive)
    try:
        yield received
    finally:
        signal.signal(signal.SIGINT, previous)
    if received:
        raise KeyboardInterrupt
