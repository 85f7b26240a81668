"""The package as one installs it: whole, quick to import, and without PyBullet where it may be."""

import ast
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import unload
from studies import paths
from unload.support import files

USE_ALL = """
import numpy as np
import unload
from studies.heap.env import HeapEnv
from unload.physics.table import LIFTS_FILE, shared_table

assert unload.__file__.startswith(FOLDER) and str(LIFTS_FILE).startswith(FOLDER)
assert len(shared_table()) > 10_000
print(unload.load_policy("recommended").card["version"])
with_heap = HeapEnv(physics="coarse")
observation, info = with_heap.reset(seed=0)
print(with_heap.step(0)[1] >= 0)
"""
# Makes an import fail as if the library were not installed.
BLOCKED = """
import sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name in NAMES:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Blocked())
"""


def run(code: str, folder: Path, *options: str, **environ: str) -> str:
    """What code prints in a new process in ``folder``, which sees no other ``unload``."""
    environ = {**os.environ, "PYTHONPATH": str(folder), **environ}
    command = [sys.executable, "-W", "error::UserWarning", *options, "-c", code]
    done = subprocess.run(command, cwd=folder, env=environ, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture
def installed(tmp_path) -> Path:
    """A folder outside the checkout with nothing but the package, built as ``make dist`` does."""
    for name in ("unload", "pyproject.toml", "README.md", "LICENSE", "Makefile"):
        subprocess.run(["cp", "-r", paths.ROOT / name, tmp_path], check=True)
    # The environment is the one that runs this, and need not be made.
    make = ["make", "--silent", f"BIN={Path(sys.executable).parent}", "--old-file=.venv/ready"]
    subprocess.run([*make, "dist"], cwd=tmp_path, check=True)
    (wheel,) = (tmp_path / "build/dist").glob("*.whl")
    target = tmp_path / "installed"
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, "--no-deps", "--target", target, wheel], check=True)
    return target


@pytest.mark.slow
def test_a_wheel_is_whole(installed):
    code = f"FOLDER = {str(installed)!r}{USE_ALL}"
    assert run(code, installed).splitlines() == [unload.__version__, "True"]
    shipped = {path.relative_to(files.SHIPPED) for path in files.SHIPPED.rglob("*.*")}
    assert shipped == {
        path.relative_to(installed / "unload/data")
        for path in (installed / "unload/data").rglob("*.*")
    }
    assert sum(path.stat().st_size for path in files.SHIPPED.rglob("*.*")) < 800_000


WITHOUT_PYBULLET = """
import gymnasium
import numpy as np
import unload

table = unload.evaluate(unload.policies.highest, episodes=2)
assert table["success_rate"].eq(1).all() and "torch" not in sys.modules
assert unload.evaluate(unload.load_policy("recommended"), episodes=2)["success_rate"].eq(1).all()
config = unload.TrainConfig(picks=1280, batch_size=64, equalize=False)
unload.train(config, "run", progress=False)
for make in (
    lambda: gymnasium.make("unload/Heap-v0"),
    lambda: unload.evaluate(unload.policies.highest, episodes=1, physics="local", max_picks=1),
):
    try:
        make()
    except ModuleNotFoundError as error:
        print(error)
"""


def test_only_what_is_simulated_needs_pybullet(tmp_path):
    """And only what is learned needs PyTorch."""
    code = "NAMES = ('pybullet',)" + BLOCKED + WITHOUT_PYBULLET
    printed = run(code, tmp_path, PYTHONPATH=str(paths.ROOT)).splitlines()
    assert len(printed) == 2 and all("pip install 'unload[pybullet]'" in line for line in printed)


def test_an_import_takes_few_modules(tmp_path):
    code = "import sys, unload; print(len(sys.modules), *sys.modules)"
    count, *names = run(code, tmp_path, PYTHONPATH=str(paths.ROOT)).split()
    assert int(count) < 700
    assert not {"torch", "numba", "pandas", "matplotlib", "plotly", "pybullet"} & set(names)


def test_names_are_where_type_checkers_find_them():
    """What is listed, what is imported for type checkers, and what is imported when it is used."""
    source = ast.parse((paths.ROOT / "unload/__init__.py").read_text())
    (typed,) = (node for node in source.body if isinstance(node, ast.If))
    found = {}
    exec(compile(ast.Module(typed.body, []), "imports", "exec"), found)
    del found["__builtins__"]
    assert found.keys() == set(unload.__all__) - {"__version__"} == unload._PLACES.keys()
    assert all(getattr(unload, name) is value for name, value in found.items())
    assert set(unload.__all__) <= set(dir(unload))
    with pytest.raises(AttributeError, match="module 'unload' has no attribute 'lift'"):
        _ = unload.lift


def test_there_is_one_version():
    project = tomllib.loads((paths.ROOT / "pyproject.toml").read_text())["project"]
    assert unload.__version__ == project["version"]
    assert f"version: {unload.__version__}" in (paths.ROOT / "CITATION.cff").read_text()
