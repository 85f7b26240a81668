"""The training loop (Sec. II-B and IV-B): ε-greedy picks, replay, updates, learning curve."""

import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, TextIO

import numpy as np
import pandas as pd
import torch
from tqdm import tqdm

from unload import task
from unload.agent.config import ENVS, TrainConfig
from unload.agent.curve import Curve
from unload.agent.dqn import DQN
from unload.agent.greedy import Greedy, load_policy, save_policy
from unload.agent.replay import ReplayBuffer
from unload.agent.rollout import Rollout
from unload.checkpoint.folder import RunFolder
from unload.checkpoint.settings import settings_of_run
from unload.load.boxes import Load, check_stack
from unload.network.factory import make_network
from unload.support import checks, files

CHECKPOINT_INTERVAL = 600.0  # seconds between two of them
CURVE_INTERVAL = 1.0  # seconds between two versions of it on disk
# With either of these instructions PyTorch draws the same first weights, without them others.
INSTRUCTIONS = ("AVX2", "AVX512")


class TrainResult(NamedTuple):
    """Policy and learning curve of a finished run.

    Attributes:
        policy: the trained network, as a greedy policy.
        curve: one row per ``unload.agent.curve.Point``, whose attributes are the columns.
    """

    policy: Greedy
    curve: pd.DataFrame

    def __repr__(self) -> str:
        end = self.curve.iloc[-1]
        said = f"{end['picks']:,.0f} picks, MSR {100 * end['success_rate']:.1f} % at the end"
        return f"TrainResult({self.policy!r}, curve of {len(self.curve)} points: {said})"


@cache  # once; Python's own filter forgets where another module changes filters
def warn_of_other_bits(instructions: str) -> None:
    """Warn where PyTorch's initial weights for a seed differ from those on most processors."""
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
        change: is called with the ``Training`` once it is set up, see ``train``; nothing if None.

    Attributes:
        settings: what the run is, as JSON can hold it.
        rollout: the environments and the picks made in them.
        agent: the ``DQN``.
        replay: the picks that the agent learns from.
        curve: the learning curve so far.
        rng: draws exploration and batches.
        kept: arrays that a change adds to the checkpoints, by name.
    """

    PARTS = ("rollout", "agent", "replay", "curve")  # that have a state of their own

    def __init__(
        self,
        config: TrainConfig,
        stack: Callable | None = None,
        change: Callable[["Training"], None] | None = None,
    ) -> None:
        self.config, self.settings = config, settings_of_run(config, stack, change)
        warn_of_other_bits(torch.backends.cpu.get_cpu_capability())
        envs_seed, rng_seed, weights_seed = config.seeds()
        self.rng = np.random.default_rng(rng_seed)
        generator = torch.Generator().manual_seed(weights_seed)
        network = make_network(config.network, config.n_features, generator)
        self.agent = DQN(network, config.learning_rate, config.gamma, config.beta)
        size = min(config.replay_size, config.picks)
        self.replay = ReplayBuffer(size, task.N_VISIBLE, next_state=config.gamma > 0)
        self.curve = Curve()
        self.rollout = Rollout(config, envs_seed, stack)
        self.kept: dict[str, np.ndarray] = {}
        if change is not None:
            change(self)

    def step(self) -> None:
        """Pick once in every environment, and learn from the picks before."""
        config, rollout = self.config, self.rollout

        # The update is begun before the picks, because the fused one can then be computed in other
        # threads while the environments step. It never learns from the picks of its own step.
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
        rows = self.rng.integers(len(self.replay), size=self.config.batch_size)
        return self.agent.start_update(self.replay.arrays, rows)

    def state_dict(self) -> dict[str, Any]:
        """Return what a checkpoint keeps: arrays, not copied, and what JSON can hold.

        PyTorch's global generator is a part of it, because dropout draws from it.
        """
        for name, array in self.kept.items():
            checks.instance(f"run.kept[{name!r}]", array, np.ndarray, "a NumPy array")
        own = {"torch": torch.get_rng_state().numpy(), "rng": self.rng.bit_generator.state}
        parts = {name: getattr(self, name).state_dict() for name in self.PARTS}
        return own | {"kept": self.kept} | parts

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Let a fresh run of the same settings go on from what ``state_dict`` returned."""
        torch.set_rng_state(torch.from_numpy(state["torch"]))
        self.rng.bit_generator.state = state["rng"]
        # In place where that is possible, because a function of a change may hold an array.
        for name, stored in state["kept"].items():
            array = self.kept.setdefault(name, stored)
            if (array.shape, array.dtype) == (stored.shape, stored.dtype):
                array[...] = stored
            else:
                self.kept[name] = stored
        for name in self.PARTS:
            getattr(self, name).load_state_dict(state[name])

    def policy(self) -> Greedy:
        """Return a copy of what has been learned so far, with a card."""
        config, settings, points = self.config, dict(self.settings), self.curve.points
        loads = settings.pop("stack") or ("the paper's" if config.env in ENVS else config.env)
        card: dict[str, Any] = {"change": settings.pop("change"), "loads": loads}
        if "engine" in settings:
            card["engine"] = settings.pop("engine")
        card["configuration"] = settings
        card["picks"] = self.rollout.picks
        card["msr"] = {"at the end of its training": points[-1].success_rate} if points else {}
        return Greedy(deepcopy(self.agent.network), config.equalize, config.ties, card)


def train(
    config: TrainConfig,
    run_dir: str | Path,
    progress: bool | TextIO = True,
    stack: Callable[[np.random.Generator], Load] | None = None,
    callback: Callable[[dict[str, float]], bool | None] | None = None,
    change: Callable[[Training], None] | None = None,
    same_code: bool = False,
) -> TrainResult:
    """Train an agent; resume where ``run_dir`` holds a checkpoint of the same run.

    A run that was stopped or killed and resumed gives the same weights and curve, bit for bit, as
    an uninterrupted one. A finished run is not repeated. The book's page "Training runs" says
    what stands in ``run_dir``, on which machines bits agree, and what ``change`` may do.

    A checkpoint keeps what ``state_dict()`` of the run's parts returns, an environment or physics
    of yours included, the parameters and buffers of the network, and the arrays of ``run.kept``.
    What stands elsewhere, in another attribute, a closure or a global, is not kept, and a run that
    depends on it resumes as another one, which ``unload.check_resume`` finds out on a small run.

    Lifts by a physics of your own are a task of your own: a run knows it by the id under which it
    is registered, and another version of it needs another id::

        from unload.env.vector import ContainerVectorEnv
        from unload.physics.table import TablePhysics

        class Gripper(TablePhysics):  # cannot hold what is wider than 0.4 m
            def simulate(self, situation):
                wide = situation.boxes[0, 4] > 400_000  # µm
                return 0.0 if wide else super().simulate(situation)

        def gripper(num_envs, **settings):
            return ContainerVectorEnv(num_envs, physics=Gripper(), **settings)

        gymnasium.register("own/Gripper-v0", vector_entry_point=gripper)
        train(TrainConfig("own/Gripper-v0"), "runs/gripper")

    Args:
        config: what to train.
        run_dir: folder of the run alone: its checkpoint, and what it leaves.
        progress: show a progress bar with speed, MSR and loss: on stdout, or in a text file.
        stack: makes the loads, as in ``ContainerEnv``; the paper's if None.
        callback: is called with each new point of the curve, a dict by the columns of
            ``TrainResult.curve``, such as ``wandb.log``, or for TensorBoard
            ``lambda point: writer.add_scalars("run", point, point["picks"])``. If it returns False,
            the run ends there, and is finished.
        change: is called with the ``Training`` before its first pick, and replaces methods.
        same_code: say that the run in ``run_dir`` was begun with the same code: with the same
            functions ``stack``, ``change`` and ``network``, of which only names are kept, and a
            package that trains in the same way. Without it a run of such functions is neither
            resumed nor read back; one of another version of the package, or of a package with other
            files, is not resumed, and a warning tells when it is read back.

    Returns:
        Policy and curve, read back from ``run_dir``.

    Raises:
        TypeError, ValueError: an argument is not as described; ``run_dir`` holds another run, or
            a damaged file; a checkpoint cannot hold the run's state.
        OSError: a file cannot be read or written.
        RuntimeError: another process is training in ``run_dir``.
        FloatingPointError: the loss or a weight is no longer finite.
        KeyboardInterrupt: after Ctrl-C or SIGTERM, and a checkpoint; a second one stops at once.
    """
    if type(config) is not TrainConfig:  # of a subclass, what it adds would not be a run's
        raise TypeError(f"config is {config!r}; expected an unload.TrainConfig")
    if not isinstance(progress, bool) and not hasattr(progress, "write"):
        raise TypeError(f"progress is {progress!r}; expected True, False or a text file")
    if callback is not None and not callable(callback):
        raise TypeError(f"callback is {callback!r}; expected a function of a dict")
    if change is not None and not callable(change):
        raise TypeError(f"change is {change!r}; expected a function of a Training")
    if stack is not None:
        check_stack(stack)
        if config.env == task.HIGHEST_ITEM_ENV:
            raise ValueError(f"stack is given; expected None for env={config.env!r}")
    folder = RunFolder(run_dir, config, stack, change, same_code)
    if not folder.finished:  # else it is only read, perhaps where nothing can be written
        with files.locked(folder.path), deferred_signals() as signals:
            if not folder.finished:  # by another process meanwhile
                run = Training(config, stack, change)
                with closing(run.rollout):
                    folder.restore(run)
                    _train_to_end(run, folder, progress, callback, signals)
    return _result(folder, config)


def finished_run(
    run_dir: str | Path, config: TrainConfig, change: Callable[[Training], None] | None = None
) -> TrainResult:
    """Read back a finished run of the same code, as ``train`` does with ``same_code``."""
    return _result(RunFolder(run_dir, config, change=change, same_code=True), config)


def _result(folder: RunFolder, config: TrainConfig) -> TrainResult:
    folder.check_finished()
    network = make_network(config.network, config.n_features)
    # As text first, because older versions of pandas miss the last bit of some numbers.
    curve = pd.read_csv(folder.curve, dtype=str).astype(float).astype({"picks": np.int64})
    return TrainResult(load_policy(folder.policy, network), curve)


def _train_to_end(
    run: Training,
    folder: RunFolder,
    progress: bool | TextIO,
    callback: Callable | None,
    signals: list[int],
) -> None:
    """Train to the end, or until the callback returns False, and finish the run.

    If it is stopped between two steps, a checkpoint of the last one is written, unless a weight is
    no longer finite. If a step itself fails, the checkpoint that was written before stays.
    """
    rollout = run.rollout
    checkpoint_saved, curve_saved = time.monotonic(), 0.0
    bar = tqdm(
        total=run.config.picks, initial=rollout.picks, unit="pick", unit_scale=True,
        mininterval=1.0, disable=not progress, ncols=100,
        file=sys.stdout if progress is True else progress,
    )  # fmt: skip
    try:
        while not rollout.finished:
            points_before = len(run.curve.points)
            run.step()
            if time.monotonic() - checkpoint_saved > CHECKPOINT_INTERVAL and not rollout.finished:
                _save_checkpoint(run, folder)
                checkpoint_saved = time.monotonic()

            with _checkpoint_if_stopped(run, folder, signals):
                bar.update(rollout.picks - bar.n)
                if len(run.curve.points) > points_before:
                    point = run.curve.points[-1]
                    shares = {"MSR": f"{point.success_rate:.1%}", "loss": f"{point.loss:.3f}"}
                    bar.set_postfix(shares, refresh=False)
                    if time.monotonic() - curve_saved > CURVE_INTERVAL:
                        folder.save_curve(run.curve.csv())
                        curve_saved = time.monotonic()
                    answer = None if callback is None else callback(point._asdict())
                    if isinstance(answer, (bool, np.bool_)) and not answer:
                        break
                if signals:
                    raise KeyboardInterrupt(
                        f"stopped after {rollout.picks} picks; call train again with "
                        f"run_dir={str(folder.path)!r} to go on"
                    )

        run.agent.check_finite()
        with _checkpoint_if_stopped(run, folder, signals):
            save_policy(run.policy(), folder.policy)
            folder.save_curve(run.curve.csv())
            folder.finish()
    except FloatingPointError as error:
        raise FloatingPointError(
            f"after {rollout.picks} picks: {error}; the last checkpoint, if any, is kept"
        ) from error
    finally:
        bar.close()


@contextmanager
def _checkpoint_if_stopped(run: Training, folder: RunFolder, signals: list[int]) -> Iterator[None]:
    """Write a checkpoint if the block, which stands between two steps, ends in an error."""
    try:
        yield
    except BaseException:  # Ctrl-C, too; a second one stops at once
        if len(signals) < 2:
            _save_checkpoint(run, folder)
        raise


def _save_checkpoint(run: Training, folder: RunFolder) -> None:
    """Write a checkpoint; raise FloatingPointError instead if a weight is no longer finite."""
    run.agent.check_finite()
    folder.save(run)


@contextmanager
def deferred_signals() -> Iterator[list[int]]:
    """Note the first Ctrl-C or SIGTERM, for a stop at a safe point; the second stops at once.

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
    previous = {kind: signal.signal(kind, receive) for kind in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield received
    finally:
        for kind, handler in previous.items():
            signal.signal(kind, handler)
    if received:
        raise KeyboardInterrupt
