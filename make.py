"""The project's commands, also where there is no make: python make.py figures (or test, lab, …).

Needs Python 3.11 to 3.14 and nothing else: the first command makes the environment, ``.venv``.
Any of these Pythons uses it then; to have it made of another one, remove it.
What follows a name is handed on, as in python make.py test -k lifts. The Makefile calls this file.
"""

# Python 3.6 must still read this file, to say which Python is needed: annotations are names alone.

import hashlib
import os
import platform
import shutil
import subprocess
import sys
import time
import venv
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parent
VENV = ROOT / ".venv"
PYTHON = VENV / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
MARK = VENV / "made-by-make"  # nothing is removed from a folder without it
STAMP = VENV / "ready"  # says what is installed
PIP = ("-m", "pip", "install", "--quiet", "--disable-pip-version-check")
LOCKED = ("-c", "environment.lock")  # the versions of all that is installed with what is named
EXTRAS = ("book", "browser")  # of pyproject.toml; the Makefile has them installed when needed
# Settings with which pip puts packages elsewhere, or installs less than it is told to. Those that
# say where it gets packages from are the user's.
ELSEWHERE = ("dry-run", "no-deps", "prefix", "python", "root", "target", "user")
VARIABLES = ("PYTHONPATH", *("PIP_" + name.upper().replace("-", "_") for name in ELSEWHERE))
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
    make_ready(*(more if name == "ready" else ()))
    for arguments in COMMANDS.get(name, ()):
        last = arguments is COMMANDS[name][-1]
        run(*arguments, *(more if last else ()))


def run(*arguments: str, without: tuple = ()) -> None:
    """Run the environment's Python without these variables, and end with it if it fails."""
    done = python(*arguments, without=without)
    if done.returncode:
        sys.exit(done.returncode)


def python(*arguments: str, without: tuple = (), **options):
    """Run the environment's Python without these variables, as ``subprocess.run`` does."""
    environment = {name: os.environ[name] for name in os.environ if name.upper() not in without}
    # Its text is UTF-8, on Windows, too.
    environment["PYTHONUTF8"] = "1"
    options["close_fds"] = False  # it holds the lock, too, see ``alone``
    return subprocess.run([str(PYTHON), *arguments], cwd=ROOT, env=environment, **options)


def make_ready(*extras: str) -> None:
    """Install what environment.txt and the extras name, unless this has been done.

    The stamp's lines say of which Python and folder the environment is, and what was installed. It
    is away while pip runs, because pip takes packages that it left half installed for whole: an
    environment without a stamp, where pip was stopped, is made again.
    """
    if not {*extras} <= {*EXTRAS}:
        sys.exit(f"ready takes {' and '.join(EXTRAS)} alone; got {' '.join(extras)}")
    files = hashlib.sha256()
    for name in ("environment.txt", "environment.lock", "pyproject.toml"):
        files.update((ROOT / name).read_bytes())
    base = files.hexdigest()
    # The package's own build takes the setuptools that has just been installed.
    editable = ("--no-deps", "--no-build-isolation", "--editable", ".")
    steps = {base: [("-r", "environment.txt", *LOCKED), editable]}
    for extra in extras:
        steps[extra] = [(*LOCKED, "--editable", f".[{extra}]")]

    with alone():
        described = describe_python()
        stamp = STAMP.read_bytes() if STAMP.is_file() else b""
        done = stamp.decode(errors="replace").splitlines()
        if done[:1] != [described]:
            make_environment()
            done = [describe_python()]
        elif described.split()[0] != "{}.{}".format(*sys.version_info):
            print(f"{VENV} is of Python {described.split()[0]}, which is used")
        if base not in done:
            done = done[:1]
        for step in steps:
            if step not in done:
                install(steps[step])
                done.append(step)
                STAMP.write_text("\n".join(done), encoding="utf-8")


def install(calls: list) -> None:
    """Let pip install with the arguments of each call; meanwhile there is no stamp."""
    check_settings()
    before = STAMP.read_bytes() if STAMP.is_file() else b""
    STAMP.unlink(missing_ok=True)
    for arguments in calls:
        try:
            run(*PIP, *arguments, without=VARIABLES)
        except SystemExit:  # pip itself gave up: nothing is half done
            if before:
                STAMP.write_bytes(before)
            raise


def check_settings() -> None:
    """End where pip's own files, such as pip.conf, hold one of the settings ``ELSEWHERE``."""
    listed = ("-m", "pip", "config", "list")
    said = python(*listed, without=VARIABLES, capture_output=True).stdout
    for line in said.decode(errors="replace").splitlines():
        name, _, value = line.partition("=")
        section, _, option = name.partition(".")
        off = value.strip("'").lower() in ("0", "false", "no", "off")
        if section in ("global", "install") and option in ELSEWHERE and not off:
            sys.exit(
                f"a file of pip's settings says {line}, so that packages would miss {VENV}; take "
                "this out of the file, which pip config debug names, and try again"
            )


def describe_python() -> str:
    """Version and folder of the environment's Python, as it says; nothing where it does not run."""
    code = "import sys; print('%d.%d' % sys.version_info[:2], ascii(sys.prefix))"
    try:
        return python("-I", "-c", code, capture_output=True).stdout.decode().strip()
    except OSError:  # it is gone, or of another machine
        return ""


@contextmanager
def alone():
    """Let one make.py at a time look after ``.venv``, and only after a folder of its own making.

    The system ends the lock with the process, however that ends; but where a pip that it has
    started goes on without it, not before this ends (on Windows with the process itself).
    """
    there = VENV.exists() and (not VENV.is_dir() or any(VENV.iterdir()))
    if VENV.is_symlink() or there and not MARK.exists():
        sys.exit(
            f"{VENV} was not made by this make.py, which therefore leaves it alone; remove or "
            "rename it, and try again"
        )
    if not there:
        VENV.mkdir(exist_ok=True)
        MARK.touch()
    with MARK.open("rb") as file:
        os.set_inheritable(file.fileno(), True)
        if not lock(file):
            print(f"Another make.py is at work on {VENV}; waiting for it")
            while not lock(file):
                time.sleep(1)
        yield


def lock(file) -> bool:
    """Lock an open file, unless another process has; return whether it is locked."""
    try:
        if os.name == "nt":
            import msvcrt

            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):  # the second on Windows
        return False
    return True


def make_environment() -> None:
    """Make ``.venv``, in place of what this function made before."""
    if any(path != MARK for path in VENV.iterdir()):
        print(f"Making {VENV} again: it is of another folder or Python, or was not finished")
    STAMP.unlink(missing_ok=True)  # first: what is half cleared is not finished
    for path in VENV.iterdir():
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        elif path != MARK:
            path.unlink()
    try:
        # A copy of some Pythons, such as Homebrew's, does not start; Windows has few links.
        venv.create(VENV, symlinks=os.name != "nt", with_pip=True, prompt="unload")
    except subprocess.CalledProcessError as error:
        print((error.output or b"").decode(errors="replace"), file=sys.stderr)
        sys.exit(
            f"{sys.executable} cannot put pip into {VENV}; on Debian and Ubuntu install "
            "python3-venv, and try again"
        )


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except KeyboardInterrupt:
        sys.exit(130)
    except (OSError, ValueError) as error:  # of files; venv's, of a path that it refuses
        sys.exit(f"make.py cannot go on: {error}")
