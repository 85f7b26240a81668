"""The package as one installs it: whole, quick to import, and without an engine where it may be."""

import ast
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import unload
from unload.support import files

ROOT = Path(__file__).resolve().parents[1]

# Makes the engines' import fail as if they were not installed, and then uses the rest.
WITHOUT_ENGINES = """
import sys

sys.modules["pybullet"] = sys.modules["mujoco"] = None

import unload
from unload.physics.table import LIFTS_FILE, shared_table

assert unload.__file__.startswith(FOLDER) and str(LIFTS_FILE).startswith(FOLDER)
assert len(shared_table()) > 10_000
table = unload.evaluate(unload.policies.highest, episodes=2)
assert table["success_rate"].eq(1).all() and "torch" not in sys.modules
assert unload.evaluate(unload.load_policy("recommended"), episodes=2)["success_rate"].eq(1).all()
exec(EXAMPLE)
config = unload.TrainConfig(picks=1280, batch_size=64, equalize=False, gradient_steps=0)
unload.train(config, "run", progress=False)
try:
    unload.evaluate(unload.policies.highest, episodes=1, physics="local", max_picks=1)
except ModuleNotFoundError as error:
    print(error)
"""


@pytest.fixture
def installed(tmp_path) -> Path:
    """A folder outside the checkout with nothing but the package, built as ``make dist`` does."""
    for name in ("unload", "studies", "pyproject.toml", "README.md", "LICENSE", "Makefile"):
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, tmp_path / name)
    # The environment is the one that runs this, and need not be made.
    make = ["make", "--silent", f"BIN={Path(sys.executable).parent}", "PYTHON=:"]
    subprocess.run([*make, "dist"], cwd=tmp_path, check=True)
    (wheel,) = (tmp_path / "build/dist").glob("*.whl")
    target = tmp_path / "installed"
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, "--no-deps", "--target", target, wheel], check=True)
    return target


def contents(folder: Path) -> dict[str, bytes]:
    """What the files of a folder hold, without what was compiled from them."""
    kept = (path for path in folder.rglob("*.*") if "__pycache__" not in path.parts)
    paths = (path for path in kept if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}


@pytest.mark.slow
@pytest.mark.needs("make")
def test_a_wheel_holds_the_package_alone_and_needs_no_checkout(installed, tmp_path, run_python):
    """Without engines all works but what is simulated, as does the README's example up to training.

    What is computed lies where one works.
    """
    before = contents(installed)
    folders = {name.partition("/")[0] for name in before}
    assert folders == {"unload", f"unload-{unload.__version__}.dist-info"}
    shipped = {f"unload/data/{name}": value for name, value in contents(files.SHIPPED).items()}
    assert shipped.items() <= before.items() and sum(map(len, shipped.values())) < 500_000
    work = tmp_path / "work"
    work.mkdir()
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    example, mark, _ = readme.partition("```python\n")[2].partition("# Training, with PyBullet")
    names = f"FOLDER = {str(installed)!r}\nEXAMPLE = {example!r}"
    options = {"PYTHONPATH": str(installed), "PYTHONWARNINGS": "error::UserWarning"}
    printed, _ = run_python(names + WITHOUT_ENGINES, work, **options)
    assert mark and printed.startswith("136 False\n") and "pip install mujoco-core" in printed
    assert contents(installed) == before
    assert sorted(path.name for path in work.iterdir()) == ["load.html", "run"]


def test_an_environment_takes_few_modules(run_python):
    """It draws nothing."""
    code = "import sys, unload; unload.ContainerEnv; print(*sys.modules)"
    names, _ = run_python(code, ROOT)
    assert not {"PIL", "matplotlib", "pandas", "plotly", "torch"} & {*names.split()}


def test_names_are_where_type_checkers_find_them():
    """What is listed, what is imported for type checkers, and what is imported when it is used."""
    source = ast.parse((ROOT / "unload/__init__.py").read_text(encoding="utf-8"))
    typed = next(node for node in source.body if isinstance(node, ast.If))
    found = {}
    exec(compile(ast.Module(typed.body, []), "imports", "exec"), found)
    del found["__builtins__"]
    assert found.keys() == set(unload.__all__) - {"__version__"} == unload._MODULES.keys()
    assert all(getattr(unload, name) is value for name, value in found.items())
    # Without ``as`` the names would not be exported for a strict type checker.
    assert all(name.asname == name.name for line in typed.body for name in line.names)
    assert set(unload.__all__) <= set(dir(unload))
    with pytest.raises(AttributeError, match="module 'unload' has no attribute 'lift'"):
        _ = unload.lift


def test_there_is_one_version():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert unload.__version__ == project["version"]
    assert f"version: {unload.__version__}" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
