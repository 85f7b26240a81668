"""Where results come from."""

import os
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from studies import paths, provenance


def test_written_and_read(tmp_path):
    record = provenance.run_record(1.25)
    provenance.write_provenance(tmp_path, "x", "make x", {"seed": 3}, True, record)
    stored = provenance.read_provenance(tmp_path, "x")
    assert stored["command"] == "make x"
    assert stored["reduced"]
    assert stored["settings"] == {"seed": 3}
    assert stored["wall_time_s"] in (1.2, 1.3)
    assert {"numba", "joblib", "torch", "pybullet", "numpy"} <= set(stored["versions"])
    assert str(os.cpu_count()) in stored["machine"]
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10
    assert stored["peak_memory_mib"] == pytest.approx(peak, rel=0.1)
    assert len(stored["revision"].rstrip("+")) == 12 or stored["revision"] == "unknown"


def test_records_are_joined():
    first = provenance.run_record(10)
    second = first | {"wall_time_s": 20.54, "peak_memory_mib": 10**6, "revision": "another"}
    together = provenance.joined([first, second, first])
    assert together["runs"] == 3
    assert together["wall_time_s"] == 40.5
    assert together["peak_memory_mib"] == 10**6
    assert together["revision"] == [first["revision"], "another"]
    assert together["machine"] == first["machine"]


# Git sets variables for its hooks, which would lead the tests' git to another repository.
OUTSIDE = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}


def commit(folder: Path) -> str:
    """Make a repository of a folder; its commit."""
    git = ["git", "-C", str(folder), "-c", "user.name=a", "-c", "user.email=a@b"]
    git += ["-c", "commit.gpgsign=false"]
    for command in (["init", "-q"], ["add", "."], ["commit", "-q", "-m", "theirs"]):
        subprocess.run([*git, *command], check=True, env=OUTSIDE)
    command = [*git, "rev-parse", "--short=12", "HEAD"]
    return subprocess.check_output(command, text=True, env=OUTSIDE).strip()


def revision_of_copy(folder: Path) -> str:
    """What the package's copy in ``folder`` gives as its revision."""
    script = "from studies import provenance; print(provenance.revision())"
    return subprocess.check_output(
        [sys.executable, "-c", script], cwd=folder, text=True, env=OUTSIDE
    ).strip()


@pytest.fixture
def copy(tmp_path) -> Path:
    """A folder with the parts of the project that find the revision, and no repository."""
    folder = tmp_path / "copy"
    for part in ("unload/support", "studies"):
        shutil.copytree(
            paths.ROOT / part, folder / part,
            ignore=lambda place, names: [name for name in names if not name.endswith(".py")],
        )  # fmt: skip
    (folder / "unload" / "__init__.py").touch()
    return folder


def test_the_projects_own_commit_is_its_revision(copy):
    shutil.copy(paths.ROOT / "pyproject.toml", copy)
    own = commit(copy)
    (copy / "README.md").write_text("not part of the package")
    (copy / ".gitignore").write_text("__pycache__\n")
    assert revision_of_copy(copy) == own
    for changed in ("unload/task.py", "studies/more.py"):
        (copy / changed).touch()
        assert revision_of_copy(copy) == f"{own}+"
        (copy / changed).unlink()
