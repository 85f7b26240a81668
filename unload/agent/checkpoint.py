"""The folder of a training run: checkpoint, policy, curve and configuration."""

import json
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from unload import task
from unload.agent.config import ENVS, TrainConfig, plain
from unload.agent.curve import Point
from unload.agent.greedy import Greedy, load_policy, save_policy
from unload.agent.state import gather, kinds, put_back
from unload.network.factory import make_network
from unload.physics.bullet import ENGINES, engine_of
from unload.support import checks, files

FORMAT = 13  # of the checkpoints
IF_OTHER_VERSION = "if another version of unload has written it, go on with that one; or remove it"
FILES = ("checkpoint.npz", "policy.safetensors", "curve.csv", "config.json")


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


def settings_of_run(
    config: TrainConfig, stack: Callable | None = None, change: Callable | None = None
) -> dict:
    """What a run is: its configuration, and the names of its change and stack, None without.

    Also the engine, if it is not PyBullet.
    """
    own = plain({"change": change, "stack": stack})
    other = {"engine": engine_of()} if engine_of() != ENGINES[0] and config.env != ENVS[1] else {}
    return config.plain() | own | other


class RunFolder:
    """The folder of one training run, which is made when it is locked.

    Attributes:
        path: of the folder, absolute, so that it stays the same one wherever the process goes.
        policy: the file of the trained policy.
    """

    def __init__(self, run_dir: str | Path) -> None:
        path = checks.path("run_dir", run_dir)
        text = str(path.absolute())  # safetensors opens a name in UTF-8 only
        if path == Path() or "\0" in text or text.encode(errors="ignore").decode() != text:
            wanted = "expected a folder of the run's own, with a name in UTF-8"
            raise ValueError(f"run_dir is {str(run_dir)!r}; {wanted}")
        self.path = path.absolute()
        paths = [checks.file("a file of run_dir", self.path / name) for name in FILES]
        self._checkpoint_file, self.policy, self._curve_file, self._config_file = paths
        self._fresh: dict[str, Any] = {}  # what a run of it holds before its first step

    @property
    def finished(self) -> bool:
        """Whether the run has ended, and its policy is whole."""
        return self._config_file.exists()

    def check_code(self, **functions: object) -> None:
        """Refuse to go on with a run of the caller's functions, of which only names are kept."""
        own = [name for name, value in functions.items() if callable(value)]
        if own and (self.finished or self._checkpoint_file.exists()):
            raise ValueError(
                f"run_dir {str(self.path)!r} holds a run with its own {' and '.join(own)}, whose "
                "code is not kept; expected same_code=True if it is the same, or another folder"
            )

    def save(self, run) -> None:
        """Write a checkpoint of a ``Training``."""
        marks = {"format": FORMAT, "version": task.VERSION, "settings": json.dumps(run.settings)}
        arrays = {name: np.array(mark) for name, mark in marks.items()}
        files.write_arrays(self._checkpoint_file, gather(run, self._fresh) | arrays)

    def save_curve(self, run) -> None:
        """Write the learning curve of a ``Training`` so far."""
        table = run.curve.table()
        files.write_text(self._curve_file, table.to_csv(index=False, lineterminator="\n"))

    def restore(self, run) -> None:
        """Let a fresh ``Training`` go on from the checkpoint, if there is one."""
        self._fresh = kinds(run)
        if not self._checkpoint_file.exists():
            return
        try:
            stored = files.read_arrays(self._checkpoint_file, checked=True)
        except ValueError as error:
            raise ValueError(f"{error}; {IF_OTHER_VERSION}") from error
        if not np.array_equal(stored.pop("format", None), FORMAT):
            raise ValueError(
                f"{self._checkpoint_file} is not of format {FORMAT}; {IF_OTHER_VERSION}"
            )
        if (version := str(stored.pop("version", None))) != task.VERSION:
            raise ValueError(f"{self._checkpoint_file} is of unload {version}; {IF_OTHER_VERSION}")
        try:
            self._check_same(dict(json.loads(str(stored.pop("settings")))), run.settings)
            put_back(run, stored)
        except (ArithmeticError, LookupError, RuntimeError, TypeError, ValueError) as error:
            reason = f"{type(error).__name__}: {error}"
            raise ValueError(f"{self._checkpoint_file} does not fit this run: {reason}") from error

    def finish(self, run) -> None:
        """Keep what a ``Training`` leaves at its end."""
        save_policy(run.policy(), self.policy)
        self.save_curve(run)
        marks = {path.name: files.digest(path) for path in (self.policy, self._curve_file)}
        # Last, because it marks the run as finished.
        files.write_json(self._config_file, run.settings | {"marks": marks}, checked=True)

    def result(self, config: TrainConfig, settings: dict) -> TrainResult:
        """Read back what a finished run of ``training.train`` has left; see ``settings_of_run``."""
        stored = files.read_json(self._config_file, checked=True)
        marks = stored.pop("marks", {})
        self._check_same(stored, settings)
        for path in (self.policy, self._curve_file):
            files.check_digest(path, marks.get(path.name))
        # A finished run needs neither its checkpoint nor what a killed process wrote of one.
        for path in (self._checkpoint_file, files.partial_of(self._checkpoint_file)):
            with suppress(OSError):  # it is gone already, or the folder is read-only
                path.unlink()
        network = make_network(config.network, config.n_features)
        # By Python's own float, because older versions of pandas miss the last bit of some.
        exact = dict.fromkeys(Point._fields[1:], lambda cell: float(cell or "nan"))
        curve = pd.read_csv(self._curve_file, converters=exact)
        return TrainResult(load_policy(self.policy, network), curve)

    def _check_same(self, stored: dict, settings: dict) -> None:
        # As text, in which 1, 1.0 and True are told apart, and not-a-number is itself.
        said = partial(json.dumps, sort_keys=True)
        differing = ", ".join(
            f"{name} ({stored.get(name)!r}, not {settings.get(name)!r})"
            for name in settings | stored
            if said(stored.get(name)) != said(settings.get(name))
        )
        if differing:
            raise ValueError(
                f"run_dir {str(self.path)!r} holds a run of another configuration: {differing}; "
                "expected the same one or an empty folder"
            )
