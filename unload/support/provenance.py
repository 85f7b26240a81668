"""Where a result comes from, written beside it."""

import os
import platform
import subprocess
import sys
from collections.abc import Iterable
from functools import cache
from importlib.metadata import version
from pathlib import Path

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
    """Write ``folder/name.provenance.json``.

    Args:
        folder: of the data.
        name: of the data file or set, for example ``"observation"``.
        command: what computes it again.
        settings: configuration and seeds.
        reduced: whether the run is smaller than the paper's.
        record: what ``run_record`` or ``joined`` returned.
    """
    content = {"command": command, "reduced": reduced, "settings": settings, **record}
    files.write_json(Path(folder) / f"{name}.provenance.json", content)


def read_provenance(folder: str | Path, name: str) -> dict:
    """What ``write_provenance`` wrote.

    Raises:
        FileNotFoundError: the data has no provenance.
    """
    return files.read_json(Path(folder) / f"{name}.provenance.json")


def run_record(seconds: float) -> dict:
    """What this process can say about a result that it has computed.

    Args:
        seconds: wall time.

    Returns:
        ``wall_time_s``, ``peak_memory_mib`` of the process so far, ``revision`` of the code,
        ``versions`` of the packages, ``python`` and ``machine``.
    """
    return {
        "wall_time_s": round(seconds, 1),
        "peak_memory_mib": _peak_memory(),
        "revision": revision(),
        "versions": {package: version(package) for package in PACKAGES},
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}, {_cpu()}, {os.cpu_count()} cores",
    }


def joined(records: Iterable[dict]) -> dict:
    """One record of several runs: their wall times added up, the highest peak of memory.

    Where they differ in the rest, all values are listed.
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
        "peak_memory_mib": max(record["peak_memory_mib"] or 0 for record in records),
        **rest,
    }


@cache
def revision() -> str:
    """The commit the code is at, with ``+`` if it was changed since."""

    def git(*arguments: str) -> str:
        command = ["git", "-C", str(files.ROOT), *arguments]
        return subprocess.check_output(command, text=True, stderr=subprocess.DEVNULL)

    try:
        commit, changed = (
            git("rev-parse", "--short=12", "HEAD"),
            git("status", "--porcelain", "unload"),
        )
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return commit.strip() + ("+" if changed else "")


def _cpu() -> str:
    """The processor's name."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        return next(line.split(": ", 1)[1] for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or "unknown processor"


def _peak_memory() -> int | None:
    """The most memory that this process has held so far, in MiB; None where not known."""
    try:
        import resource  # not on Windows
    except ImportError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak // (2**20 if sys.platform == "darwin" else 2**10)
