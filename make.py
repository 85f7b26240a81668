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
PROMPT = "unload"  # of an activated environment; says, too, that it was made here
PIP = ("-m", "pip", "install", "--quiet", "--disable-pip-version-check")
# A process a core, eight at most, because each takes 1 GB.
PYTEST = ("-m", "pytest", "-n", "logical", "--maxprocesses", "8", "--dist", "loadfile")
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
    """Install what the two files name, and then an extra, unless this has been done.

    A file in the environment says what was done, and for which checkout and Python.
    """
    wanted = hashlib.sha256(f"{sys.version} {sys.base_prefix} {ROOT}".encode())
    for name in ("environment.txt", "pyproject.toml"):
        wanted.update((ROOT / name).read_bytes())
    stamp = VENV / ("ready" if extra is None else f"ready-{extra}")
    done = stamp.read_text(encoding="utf-8") if stamp.exists() else ""
    if done == wanted.hexdigest() and PYTHON.exists():
        return
    if extra is None:
        make_environment()
        run(*PIP, "-r", "environment.txt")
        run(*PIP, "--no-deps", "--editable", ".")
    else:
        run(*PIP, "-c", "environment.txt", "--editable", f".[{extra}]")
    # Last, so that an installation that was broken off is done again.
    stamp.write_text(wanted.hexdigest(), encoding="utf-8")


def make_environment() -> None:
    """Make ``.venv``, unless it works; one that was not made by this function is not cleared."""
    config = VENV / "pyvenv.cfg"
    there = config.read_text(encoding="utf-8") if config.exists() else ""
    if works(there):
        return
    foreign = there and f"prompt = {PROMPT!r}" not in there
    if foreign or VENV.is_symlink() or (VENV / "conda-meta").exists():
        sys.exit(
            f"{VENV} does not work with Python {platform.python_version()} in this folder, and was "
            "not made by make.py, which therefore leaves it alone; move it away, and try again"
        )
    if there:
        print(f"Making {VENV} again: it is of another folder or Python, or was not finished")
    config.unlink(missing_ok=True)  # first: a folder without it is known to be half cleared
    try:
        # A copy of some Pythons, such as Homebrew's, does not start; Windows has few links.
        venv.create(VENV, clear=True, symlinks=os.name != "nt", with_pip=True, prompt=PROMPT)
    except subprocess.CalledProcessError as error:
        print((error.output or b"").decode(errors="replace"), file=sys.stderr)
        sys.exit(
            f"{sys.executable} cannot put pip into {VENV}; on Debian and Ubuntu install "
            "python3-venv, and try again"
        )


def works(config: str) -> bool:
    """Whether ``.venv``, with such a configuration, was made here for this Python, and has pip."""
    if f"version = {platform.python_version()}\n" not in config or f" {VENV}\n" not in config:
        return False
    pip = [str(PYTHON), "-m", "pip", "show", "--quiet", "pip"]
    try:
        return subprocess.run(pip, capture_output=True).returncode == 0
    except OSError:  # its Python is gone, or of another machine
        return False


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except KeyboardInterrupt:
        sys.exit(130)
