"""Where a data file comes from, written beside it."""

import os
import platform
import subprocess
from importlib.metadata import version
from pathlib import Path

from unload import files

PACKAGES = ("gymnasium", "numpy", "pandas", "pybullet", "torch")


def write_provenance(
    folder: str | Path, name: str, command: str, settings: dict, seconds: float, reduced: bool
) -> None:
    """Write ``folder/name.provenance.json``.

    Args:
        folder: of the data.
        name: of the data file or set, for example ``"observation"``.
        command: what computes it again.
        settings: configuration and seeds.
        seconds: wall time.
        reduced: whether the run is smaller than the paper's.
    """
    record = {
        "command": command,
        "reduced": reduced,
        "settings": settings,
        "wall_time_s": round(seconds, 1),
        "revision": _revision(),
        "versions": {package: version(package) for package in PACKAGES},
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores",
    }
    files.write_json(Path(folder) / f"{name}.provenance.json", record)


def read_provenance(folder: str | Path, name: str) -> dict:
    """What ``write_provenance`` wrote.

    Raises:
        FileNotFoundError: the data has no provenance.
    """
    return files.read_json(Path(folder) / f"{name}.provenance.json")


def _revision() -> str:
    """The commit the code is at, with ``+`` if it was changed since."""
    git = ["git", "-C", str(files.ROOT)]
    try:
        commit = subprocess.check_output([*git, "rev-parse", "--short=12", "HEAD"], text=True)
        changed = subprocess.check_output([*git, "status", "--porcelain", "unload"], text=True)
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return commit.strip() + ("+" if changed else "")
