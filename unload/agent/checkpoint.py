"""The folder of a training run: checkpoint, policy, curve and configuration."""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from unload.agent.config import TrainConfig
from unload.agent.greedy import Greedy, load_policy, save_policy
from unload.agent.identity import identity, unchanged
from unload.agent.rollout import Rollout
from unload.support import checks, files

FORMAT = 5  # of the checkpoints
# Of a ``Training``: what has a state besides the generator.
STATEFUL = ("agent", "curve", "rollout")


class TrainResult(NamedTuple):
    """Policy and learning curve of a finished run.

    Attributes:
        policy: the trained network, as a greedy policy.
        curve: one row per ``log_interval`` steps, means over it: ``picks`` so far,
            ``mean_reward``, ``success_rate`` (MSR of the exploring agent), ``deadlocked``
            (share of picks whose item had already failed since the last success), ``loss``
            (NaN before the first update), ``epsilon``, and ``wall_time`` in s since the epoch.
    """

    policy: Greedy
    curve: pd.DataFrame


def settings_of(config: TrainConfig, stack: Callable | None, change: Callable) -> dict:
    """What a run is: its configuration, and the identity of its change and stack, None without."""
    change = None if change is unchanged else identity(change)
    return asdict(config) | {"change": change, "stack": stack and identity(stack)}


class RunFolder:
    """The folder of one training run.

    Args:
        run_dir: made when it is locked or written to, if it does not exist.

    Attributes:
        path: of the folder.
        checkpoint: the file from which a run that was stopped goes on.

    Raises:
        TypeError: ``run_dir`` is no path.
        ValueError: ``run_dir`` is empty.
    """

    def __init__(self, run_dir: str | Path) -> None:
        self.path = checks.path("run_dir", run_dir)
        if self.path == Path():
            raise ValueError(f"run_dir is {str(run_dir)!r}; expected a folder of the run's own")
        self.checkpoint = self.path / "checkpoint.npz"
        self._policy, self._curve = self.path / "policy.safetensors", self.path / "curve.csv"
        self._config = self.path / "config.json"

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other processes out of the folder, see ``files.locked``.

        What a killed process has left half written of the run's files is removed.
        """
        with files.locked(self.path):
            for path in (self.checkpoint, self._policy, self._curve, self._config):
                for leftover in self.path.glob(f"{path.name}.*.partial"):
                    leftover.unlink()
            yield

    @property
    def finished(self) -> bool:
        """Whether the run has made all its picks."""
        return self._config.exists()

    def save(self, run) -> None:
        """Write a checkpoint of a ``Training``."""
        arrays = {
            f"{part}.{name}": array
            for part in STATEFUL
            for name, array in getattr(run, part).state().items()
        }
        arrays |= {
            "format": np.array(FORMAT),
            "config": np.array(json.dumps(run.settings)),
            "rng": np.array(json.dumps(run.rng.bit_generator.state)),
        }
        files.write_arrays(self.checkpoint, arrays)

    def save_curve(self, run) -> None:
        """Write the learning curve of a ``Training`` so far."""
        files.write_text(self._curve, run.curve.table().to_csv(index=False))

    def restore(self, run) -> Iterator[int]:
        """Let a ``Training`` go on from the checkpoint, if there is one.

        Yields:
            How many picks the checkpoint holds, after each step that is repeated.

        Raises:
            ValueError: the checkpoint is damaged, or of another configuration, version or stack.
        """
        if not self.checkpoint.exists():
            return
        stored = files.read_arrays(self.checkpoint)
        checks.entries(str(self.checkpoint), stored, ("config",))
        if not np.array_equal(stored.get("format"), FORMAT):
            raise ValueError(
                f"{self.checkpoint} was written by another version of unload; expected format "
                f"{FORMAT}. Remove it to start anew, or go on with that version"
            )
        try:
            config = dict(json.loads(str(stored["config"])))
        except (TypeError, ValueError) as error:
            raise ValueError(f"{self.checkpoint} holds no configuration: {error}") from error
        self._check_same(config, run.settings)
        parts: dict[str, dict[str, np.ndarray]] = {part: {} for part in STATEFUL}
        for name, array in stored.items():
            part, _, rest = name.partition(".")
            if part in parts:
                parts[part][rest] = array
        try:
            run.agent.load_state(parts["agent"])
            run.curve.load_state(parts["curve"])
            run.rng.bit_generator.state = json.loads(str(stored["rng"]))
            first = int(parts["rollout"]["start"])
            run.replay.total = first * run.config.num_envs
            picks = run.replay.total + parts["rollout"]["actions"].size
            for transitions in run.rollout.load_state(parts["rollout"]):
                run.replay.add(**transitions)
                yield picks
        except KeyError as error:
            raise ValueError(f"{self.checkpoint} has no array {error}; it is damaged") from error
        except (IndexError, OverflowError, TypeError, ValueError, RuntimeError) as error:
            raise ValueError(f"{self.checkpoint}: {error}") from error

    def finish(self, run, first_shown: str) -> None:
        """Write what a ``Training`` leaves.

        Args:
            run: at its end.
            first_shown: digest of its first observations, which shows what loads it was on.
        """
        save_policy(run.policy(), self._policy)
        self.save_curve(run)
        marks = {"first_loads": first_shown}
        marks |= {path.name: files.digest(path) for path in (self._policy, self._curve)}
        content = run.settings | {"marks": marks}
        # Last, because it marks the run as finished.
        files.write_json(self._config, content, checked=True)

    def result(
        self, config: TrainConfig, stack: Callable | None = None, change: Callable = unchanged
    ) -> TrainResult:
        """Read back what a finished run has left.

        Args:
            config, stack, change: of the run, see ``training.train_changed``.

        Raises:
            ValueError: a file is damaged, or the run is of another configuration or stack.
            FileNotFoundError: a file is missing.
        """
        stored = files.read_json(self._config)
        marks = stored.get("marks")
        marks = marks if isinstance(marks, dict) else {}
        stored = {name: stored[name] for name in stored if name != "marks"}
        self._check_same(stored, settings_of(config, stack, change))
        rollout = Rollout(config, 1, stack)
        rollout.close()
        if marks.get("first_loads") != rollout.digest():
            raise ValueError(
                f"run_dir {str(self.path)!r} holds a run on other loads; expected the stack that "
                "it was trained with, or an empty folder"
            )
        for path in (self._policy, self._curve):
            files.check_digest(path, marks.get(path.name))
        with suppress(OSError):  # it is gone already, or the folder is read-only
            self.checkpoint.unlink()
        return TrainResult(load_policy(self._policy), pd.read_csv(self._curve))

    def _check_same(self, stored: dict, settings: dict) -> None:
        """Raise ValueError unless stored settings are ``settings``."""
        wanted = json.loads(json.dumps(settings))
        # How often it is saved changes nothing in a run.
        names = [name for name in wanted | stored if name != "checkpoint_interval"]
        differing = [name for name in names if stored.get(name) != wanted.get(name)]
        if differing:
            details = ", ".join(
                f"{name} ({stored.get(name)!r}, not {wanted.get(name)!r})" for name in differing
            )
            raise ValueError(
                f"run_dir {str(self.path)!r} holds a run of another configuration: {details}; "
                "expected the same one or an empty folder"
            )
