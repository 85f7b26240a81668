"""One way to keep a result, to publish it, and to read it back.

A result that took long is kept in ``runs/`` under the question that it answers; a published
one is a table in ``data/``, with its provenance in the ``provenance.json`` of its folder: command,
settings, code, versions, machine and time.
"""

import ast
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import cache, partial
from importlib.metadata import PackageNotFoundError, version
from inspect import getsourcefile
from operator import attrgetter
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import joblib
import pandas as pd
import torch
from joblib import Parallel, delayed
from tqdm import tqdm

from studies import paths
from studies.fingerprint import (
    evaluation_fingerprint,
    physics_fingerprint,
    training_fingerprint,
)
from unload.physics.bullet import ENGINES, engine_of
from unload.support import files

PACKAGES = ("gymnasium", "joblib", "mujoco-core", "numba", "numpy", "pandas", "pybullet", "torch")
COMMAND = "python -m studies"


class Result(NamedTuple):
    """A computed value and what ``run_record`` says of the computation."""

    value: Any
    record: dict


def measured(compute: Callable[[], Any]) -> Result:
    """Compute a value, with its ``run_record``."""
    start = time.monotonic()
    value = compute()
    return Result(value, run_record(time.monotonic() - start))


def kept(folder: str | Path, question: dict, compute: Callable[[], Any]) -> Result:
    """The answer to a question, computed once and kept in a file of ``folder``.

    Each has a digest, and one that cannot be read is computed again. Nothing is pickled, so that
    reading a file that somebody else has made runs no code.

    Args:
        question: all that the answer depends on: an answer to another question is not taken.
        compute: gives the answer, see ``files.write_nested`` for what it may hold.

    Returns:
        The answer and its record, as they are read back; tuples have become lists, and NumPy's
        scalars Python's.

    Raises:
        TypeError: the answer holds something else.
        OSError: the folder cannot be made, or a folder with files stands where the answer should.
    """
    path = Path(folder) / f"{joblib.hash(question)}.npz"
    # What is in the way is found before the computation, which may take hours.
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.exists():
        try:
            return _read_answer(path)
        except (ValueError, OSError) as error:
            if path.is_dir():
                path.rmdir()
            print(f"{error}. It is computed again", file=sys.stderr)
    answer = measured(compute)._asdict() | {"question": path.stem}
    with files.locked(path.parent, wait=True):  # another command may ask the same
        files.write_nested(path, answer)
    return _read_answer(path)


def _read_answer(path: Path) -> Result:
    answer = files.read_nested(path)
    try:
        # The digest of the question, which names the file, too: it may be a copy of another one.
        if answer.pop("question") != path.stem:
            raise KeyError("question")
        return Result(**answer)
    except (AttributeError, KeyError, TypeError) as error:
        raise ValueError(f"{path} holds no answer: {error!r}") from error


def code_of(value: Any) -> str:
    """Digest of a value, in which a function or class counts by its name and its module's files.

    These are the module's own file and all files of the studies that it imports, directly or not,
    so that an answer is computed again after a change in any of them, also in one that does not
    matter to it. For ``unload`` the fingerprints stand.

    Raises:
        TypeError: a function is not what its module holds under its name, so that others may share
            both: a lambda, one made in a function, a method of an instance; or it is an instance.
    """
    return joblib.hash(_written(value))


def _written(value: Any) -> Any:
    """Replace what pickle would write by name or by address, at any depth."""
    if isinstance(value, partial):
        return [_written(value.func), _written(value.args), _written(value.keywords)]
    if isinstance(value, (list, tuple)):
        return [_written(entry) for entry in value]
    if isinstance(value, dict):
        return {name: _written(entry) for name, entry in value.items()}
    if isinstance(value, torch.nn.Module):
        return [_written(type(value)), repr(value), _written(dict(value.state_dict()))]
    if isinstance(value, torch.Tensor):
        return value.detach().cpu().numpy()
    if callable(value):
        module = _module_of(value)
        return [module.__name__, value.__qualname__, _files_of(getsourcefile(module))]
    return value


@cache
def _files_of(source: str) -> list[str]:
    """Digests of a file and of all files of the studies that it imports, directly or not."""
    found: dict[Path, str] = {}
    left = [Path(source)]
    while left:
        path = left.pop()
        if path in found or not path.is_file():
            continue
        found[path] = files.digest(path)
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.module:
                names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
            for name in names:
                if name.split(".")[0] == "studies":
                    place = paths.ROOT / name.replace(".", "/")
                    left += [place.with_suffix(".py"), place / "__init__.py"]
    return [found[path] for path in sorted(found)]


def _module_of(value: Callable) -> ModuleType:
    """The module that holds a function or class under its name."""
    with suppress(AttributeError, KeyError):
        module = sys.modules[value.__module__]
        if attrgetter(value.__qualname__)(module) is value:
            return module
    raise TypeError(f"{value!r} cannot be found by its name; expected a function of a module")


def keep_all(
    place: str, compute: Callable, asked: Sequence[tuple[dict, tuple]], n_jobs: int
) -> list[Result]:
    """``kept`` for several questions to the same code, side by side.

    Args:
        place: the folder in ``runs/``.
        compute: gives an answer; its code is a part of each question, see ``code_of``, and so are
            the fingerprints of training, of the physics and of ``evaluate``.
        asked: the rest of each question, and the arguments of ``compute``.
        n_jobs: processes.
    """
    folder = paths.RUNS / place
    code = {"code": code_of(compute), "fingerprint": training_fingerprint()}
    code["fingerprint of physics"] = physics_fingerprint()
    code["fingerprint of evaluation"] = evaluation_fingerprint()
    answers = Parallel(n_jobs, return_as="generator")(
        delayed(kept)(folder, question | code, partial(compute, *arguments))
        for question, arguments in asked
    )
    bar = {"total": len(asked), "unit": "result", "ncols": 100}
    return list(tqdm(answers, file=sys.stdout, **bar))


def publish(
    name: str | Path,
    tables: Mapping[str, pd.DataFrame],
    command: str,
    settings: dict,
    results: Iterable[Result],
    fingerprint: str | None = None,
    float_format: str = "%.6g",
) -> None:
    """Write tables of results and, last, their provenance.

    Args:
        name: of the data, with its folder in ``data/``, such as ``"falls/laboratory"``.
        tables: by name; they stand in the same folder.
        command: what computes them again.
        settings: configuration and seeds.
        results: of which they are made; their records are joined.
        fingerprint: of the training that the results rest on, see ``training_fingerprint``;
            None if they rest on none, or on one that is not known.
        float_format: of the tables.
    """
    for table_name, table in tables.items():
        write_table(Path(name).with_name(table_name), table, float_format)
    record = joined(result.record for result in results)
    if fingerprint is not None:
        record["fingerprint"] = fingerprint
    write_provenance(name, command, settings, record)


def write_table(name: str | Path, table: pd.DataFrame, float_format: str = "%.6g") -> None:
    """Write ``data/<name>.csv``, without the table's index, in one atomic step."""
    path = paths.DATA / f"{name}.csv"
    files.write_text(
        path, table.to_csv(index=False, float_format=float_format, lineterminator="\n")
    )


def read_table(name: str | Path) -> pd.DataFrame:
    """The table ``data/<name>.csv``; what publishes it says what its columns are."""
    path = paths.DATA / f"{name}.csv"
    if not path.is_file():
        said = f"the command that makes it stands in {provenance_file(name)}"
        raise FileNotFoundError(f"{path} is missing; {said}")
    return pd.read_csv(path)


def write_provenance(name: str | Path, command: str, settings: dict, record: dict) -> None:
    """Write the provenance of data, see ``publish``; the record is ``joined``."""
    path, own = provenance_file(name), {"command": command, "settings": settings, **record}
    with files.locked(paths.RUNS / "provenance", wait=True):  # two parts may end at the same time
        there = files.read_json(path) if path.exists() else {}
        files.write_json(path, dict(sorted((there | {Path(name).name: own}).items())))


def read_provenance(name: str | Path) -> dict:
    """Return the provenance of data, empty if there is none."""
    path = provenance_file(name)
    return files.read_json(path).get(Path(name).name, {}) if path.exists() else {}


def provenance_file(name: str | Path) -> Path:
    """Of data in a folder of ``data/``, or elsewhere if ``name`` is an absolute path."""
    return (paths.DATA / name).with_name("provenance.json")


def run_record(seconds: float) -> dict:
    """Record of the process that has computed a result, in so many seconds of wall time.

    Returns:
        ``wall_time_s``, ``revision`` of the code, ``versions`` of the packages, ``engine`` that
        decides lifts, ``python`` and ``machine``.
    """
    versions = {}
    for package in PACKAGES:
        with suppress(PackageNotFoundError):  # not all of them need be installed
            versions[package] = version(package)
    return {
        "wall_time_s": round(seconds, 1),
        "revision": revision(),
        "versions": versions,
        "engine": engine_of(),
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}, {_cpu()}, {os.cpu_count()} cores",
    }


def joined(records: Iterable[dict]) -> dict:
    """Return one record of several runs, or of records that are joined themselves.

    Their number, the sum of their wall times; and of the rest the one value that all share, or
    the list of those that occur.
    """
    # Records that were kept while there was one engine do not name it.
    records, rest = [{"engine": ENGINES[0]} | record for record in records], {}
    for name in ("revision", "versions", "engine", "python", "machine"):
        several = [
            record[name] if isinstance(record[name], list) else [record[name]] for record in records
        ]
        values = list({str(value): value for values in several for value in values}.values())
        rest[name] = values[0] if len(values) == 1 else values
    return {
        "runs": sum(record.get("runs", 1) for record in records),
        "wall_time_s": round(sum(record["wall_time_s"] for record in records), 1),
        **rest,
    }


@cache
def revision() -> str:
    """The project's commit, with ``+`` if ``unload`` or ``studies`` was changed since.

    ``"unknown"`` where they do not lie at the top of a repository.
    """
    root = paths.ROOT
    # A named repository, because git would otherwise take an enclosing one.
    git = ["git", "--git-dir", str(root / ".git"), "--work-tree", str(root)]

    def output(*arguments: str) -> str:
        command = [*git, *arguments]
        return subprocess.check_output(command, cwd=root, text=True, stderr=subprocess.DEVNULL)

    try:
        commit = output("rev-parse", "--short=12", "HEAD").strip()
        changed = output("status", "--porcelain", "unload", "studies")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return commit + ("+" if changed else "")


def _cpu() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        return next(line.split(": ", 1)[1] for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or "unknown processor"
