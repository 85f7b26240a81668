"""Provenance of results: command, settings, code, versions, machine and time, as JSON."""

import os
import platform
import resource
import subprocess
import sys
from collections.abc import Iterable
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from studies import paths
from unload.support import files

PACKAGES = ("gymnasium", "joblib", "numba", "numpy", "pandas", "pybullet", "torch")


def write_provenance(
    folder: str | Path,
    name: str,
    command: str,
    settings: dict,
    reduced: bool,
    record: dict,
) -> None:
    """Write ``folder/name.provenance.json``, see ``results.publish``; the record is ``joined``."""
    content = {"command": command, "reduced": reduced, "settings": settings, **record}
    files.write_json(Path(folder) / f"{name}.provenance.json", content)


def read_provenance(folder: str | Path, name: str) -> dict:
    """Return the content of ``folder/name.provenance.json``."""
    return files.read_json(Path(folder) / f"{name}.provenance.json")


def run_record(seconds: float) -> dict:
    """Record of the process that has computed a result.

    Args:
        seconds: wall time.

    Returns:
        ``wall_time_s``, ``peak_memory_mib`` of the process so far, ``revision`` of the code,
        ``versions`` of the packages, ``python`` and ``machine``.
    """
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss  # KiB, but on macOS bytes
    return {
        "wall_time_s": round(seconds, 1),
        "peak_memory_mib": peak // (2**20 if sys.platform == "darwin" else 2**10),
        "revision": revision(),
        "versions": _versions(),
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}, {_cpu()}, {os.cpu_count()} cores",
    }


def joined(records: Iterable[dict]) -> dict:
    """Return one record of several runs.

    Their number, the sum of their wall times, the highest peak of memory; and of the rest the
    one value that all share, or the list of those that occur.
    """
    records = list(records)
    rest = {}
    for name in ("revision", "versions", "python", "machine"):
        values = []
        for record in records:
            if record[name] not in values:
                values.append(record[name])
        rest[name] = values[0] if len(values) == 1 else values
    return {
        "runs": len(records),
        "wall_time_s": round(sum(record["wall_time_s"] for record in records), 1),
        "peak_memory_mib": max(record["peak_memory_mib"] for record in records),
        **rest,
    }


def _versions() -> dict[str, str]:
    """The versions of ``PACKAGES``, by name, without those that are not installed."""
    found = {}
    for package in PACKAGES:
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    return found


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
    """Name of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        return next(line.split(": ", 1)[1] for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or "unknown processor"
