"""The project's commands, also where there is no make: python make.py figures (or test, lab, …).

Needs Python 3.11 to 3.14 and nothing else: the first command makes the environment, ``.venv``.
What follows a name is handed on, as in python make.py test -k lifts. The Makefile calls this file.
"""

import hashlib
import os
import platform
import subprocess
import sys
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent
VENV = ROOT / ".venv"
PYTHON = VENV / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
PIP = ("-m", "pip", "install", "--quiet", "--disable-pip-version-check")
PYTEST = ("-m", "pytest", "-n", "2", "--dist", "loadfile")
# Left out: tests marked slow; those that compile anew, kill runs or simulate every box, by name;
# studies and notebooks.
QUICK = ("-m", "not slow", "-k", "not (compiled or killed or full)")
QUICK += ("--ignore", "tests/studies", "--ignore", "tests/test_notebooks.py")
# By name: the arguments of the Pythons that do it.
COMMANDS = {
    "figures": [("notebooks/run.py",)],
    "test": [PYTEST],
    "lab": [("-m", "jupyterlab", "--notebook-dir=notebooks")],
    "quick": [PYTEST + QUICK],
    "lint": [("-m", "ruff", "check"), ("-m", "ruff", "format", "--check"), ("-m", "mypy")],
    "notebooks": [("notebooks/run.py", "--in-place")],
    "paper": [("-m", "studies", "paper"), ("notebooks/run.py", "--in-place")],
    "bench": [("-m", "studies.speed.run")],
}


def main(name: str = "", *more: str) -> None:
    """Run a command; ``ready`` makes the environment alone, with the extras that are named."""
    if name not in (*COMMANDS, "ready"):
        sys.exit(f"{__doc__}\nCommands: {', '.join(COMMANDS)}, ready")
    if not (3, 11) <= sys.version_info[:2] <= (3, 14):
        sys.exit(f"{sys.executable} is Python {platform.python_version()}; expected 3.11 to 3.14")
    make_ready()
    if name == "ready":
        for extra in more:
            make_ready(extra)
    for arguments in COMMANDS.get(name, ()):
        last = arguments is COMMANDS[name][-1]
        run(*arguments, *(more if last else ()))


def run(*arguments: str) -> None:
    """Run the environment's Python, and end with it if it fails."""
    # Its text is UTF-8, on Windows, too.
    environment = os.environ | {"PYTHONUTF8": "1"}
    done = subprocess.run([str(PYTHON), *arguments], cwd=ROOT, env=environment)
    if done.returncode:
        sys.exit(done.returncode)


def make_ready(extra: str | None = None) -> None:
    """Install what the two files name, and then an extra, unless this has been done."""
    wanted = hashlib.sha256(sys.version.encode())
    for name in ("environment.txt", "pyproject.toml"):
        wanted.update((ROOT / name).read_bytes())
    stamp = VENV / ("ready" if extra is None else f"ready-{extra}")
    if stamp.exists() and stamp.read_text(encoding="utf-8") == wanted.hexdigest():
        return
    if extra is None:
        config = VENV / "pyvenv.cfg"
        there = config.read_text(encoding="utf-8") if config.exists() else ""
        if f"version = {platform.python_version()}\n" not in there:
            venv.create(VENV, with_pip=True, clear=True)
        run(*PIP, "-r", "environment.txt")
        run(*PIP, "--no-deps", "--editable", ".")
    else:
        run(*PIP, "-c", "environment.txt", "--editable", f".[{extra}]")
    # Last, so that an installation that was broken off is done again.
    stamp.write_text(wanted.hexdigest(), encoding="utf-8")


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except KeyboardInterrupt:
        sys.exit(130)
