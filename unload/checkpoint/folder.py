"""The folder of a training run: its checkpoint, and what it leaves at its end."""

import json
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from unload.checkpoint.settings import package, settings_of_run
from unload.support import checks, files

FORMAT = 14  # of the checkpoints
IF_OTHER_VERSION = "if another version of unload has written it, go on with that one; or remove it"
FILES = ("checkpoint.npz", "policy.safetensors", "curve.csv", "config.json")
PARTIAL = "checkpoint.npz.*.partial"  # what killed processes wrote of one, see ``support/files.py``


class RunFolder:
    """The folder of one training run, which is made when it is locked.

    Args:
        run_dir: its path.
        config, stack, change: of the run, see ``unload.train``.
        same_code: whether the caller says that the run was begun with the same code.

    Attributes:
        path: of the folder, absolute, so that it stays the same one wherever the process goes.
        policy: the file of the trained policy.
        curve: the file of the learning curve.

    Raises:
        TypeError, ValueError: an argument is not as described; or the folder holds a run of the
            caller's own functions, of which only names are kept, and not ``same_code``.
    """

    def __init__(
        self,
        run_dir: str | Path,
        config: Any,
        stack: Callable | None = None,
        change: Callable | None = None,
        same_code: bool = False,
    ) -> None:
        path = checks.path("run_dir", run_dir)
        text = str(path.absolute())  # safetensors opens a name in UTF-8 only
        if path == Path() or "\0" in text or text.encode(errors="ignore").decode() != text:
            wanted = "expected a folder of the run's own, with a name in UTF-8"
            raise ValueError(f"run_dir is {str(run_dir)!r}; {wanted}")
        self.path, self._same_code = path.absolute(), checks.boolean("same_code", same_code)
        paths = [checks.file("a file of run_dir", self.path / name) for name in FILES]
        self._checkpoint_file, self.policy, self.curve, self._config_file = paths

        functions = {"stack": stack, "change": change, "network": config.network}
        own = [name for name, value in functions.items() if callable(value)]
        begun = self.finished or self._checkpoint_file.exists()
        if own and begun and not self._same_code:
            raise ValueError(
                f"run_dir {str(self.path)!r} holds a run with its own {' and '.join(own)}, whose "
                "code is not kept; expected same_code=True if it is the same, or another folder"
            )
        self._settings = settings_of_run(config, stack, change)

    @property
    def finished(self) -> bool:
        """Whether the run has ended; ``check_finished`` finds what was damaged since then."""
        return self._config_file.exists()

    def save(self, run: Any) -> None:
        """Write the ``state_dict()`` of a run as its checkpoint."""
        # First, because the disk may have no room for it beside the old checkpoint and the new one.
        self._remove(PARTIAL)
        marks = {"format": FORMAT, "package": package(), "settings": self._settings}
        files.write_nested(self._checkpoint_file, marks | {"run": run.state_dict()})

    def restore(self, run: Any) -> None:
        """Let a fresh run ``load_state_dict`` from the checkpoint, if there is one."""
        file = self._checkpoint_file
        if not file.exists():
            return
        try:
            stored = files.read_nested(file)
        except ValueError as error:
            raise ValueError(f"{error}; {IF_OTHER_VERSION}") from error
        if not isinstance(stored, dict) or stored.get("format") != FORMAT:
            raise ValueError(f"{file} is not of format {FORMAT}; {IF_OTHER_VERSION}")
        if (begun_by := stored.get("package")) != package() and not self._same_code:
            wanted = f"expected {package()}, or same_code=True if both train in the same way"
            raise ValueError(f"{file} is of {begun_by}; {wanted}; {IF_OTHER_VERSION}")
        try:
            self._check_settings(stored["settings"])
            run.load_state_dict(stored["run"])
        except (ArithmeticError, LookupError, RuntimeError, TypeError, ValueError) as error:
            reason = f"{type(error).__name__}: {error}"
            raise ValueError(f"{file} does not fit this run: {reason}") from error

    def save_curve(self, text: str) -> None:
        """Write the learning curve so far, as CSV."""
        files.write_text(self.curve, text)

    def finish(self) -> None:
        """Mark the run as finished, whose policy and curve have been written."""
        digests = {path.name: files.digest(path) for path in (self.policy, self.curve)}
        made = {"marks": digests, "package": package()}
        files.write_json(self._config_file, self._settings | made, checked=True)

    def check_finished(self) -> None:
        """Raise ValueError unless what a finished run has left is whole, and of this run.

        Then its checkpoint, which nothing needs any more, is removed.
        """
        stored = files.read_json(self._config_file, checked=True)
        digests, made_by = stored.pop("marks", {}), stored.pop("package", "an earlier unload")
        self._check_settings(stored)
        for path in (self.policy, self.curve):
            files.check_digest(path, digests.get(path.name))
        if made_by != package() and not self._same_code:
            said = f"{self.path} holds a run that {made_by} has trained, and this is {package()}"
            said += "; same_code=True says that both train in the same way"
            warnings.warn(said, stacklevel=4)  # of the caller of ``train``
        for pattern in (self._checkpoint_file.name, PARTIAL):
            self._remove(pattern)

    def _remove(self, pattern: str) -> None:
        for path in self.path.glob(pattern):
            with suppress(OSError):  # it is gone already, or the folder is read-only
                path.unlink()

    def _check_settings(self, stored: dict) -> None:
        # As text, in which 1, 1.0 and True are told apart, and not-a-number is itself.
        said = partial(json.dumps, sort_keys=True)
        settings = self._settings
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
