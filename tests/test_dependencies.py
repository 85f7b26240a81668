"""The libraries: named in pyproject.toml, pinned in environment.txt, and imported somewhere."""

import ast
import json
import platform
import re
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from importlib.metadata import packages_distributions, version
from pathlib import Path

from tests import wheels

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
# What loads and orders need, and what the rest of the package does.
OF_THE_PACKAGE = ("train", "view")
EXTRAS = PROJECT["optional-dependencies"]
NEEDED = [*PROJECT["dependencies"], *(name for extra in OF_THE_PACKAGE for name in EXTRAS[extra])]
LOWEST = dict(library.split(">=") for library in NEEDED)  # versions by name
PINNED = {name: version for name, (version, _) in wheels.lines().items()}
DISTRIBUTIONS = packages_distributions()  # by the names that are imported
OWN = {"make", "notebooks", "studies", "tests", "unload"}
WITH_PYTHON = {"pip"}
# Extras for one command each, pinned in pyproject.toml.
ON_DEMAND = ("book", "browser")
# Extras of the package that nothing here needs.
ASIDE = ("excel", "video")
# Named, but imported by no statement, and what for.
RUN_ONLY = {
    "dask": "joblib's backend for a cluster",
    "ipykernel": "runs the notebooks",
    "jupyterlab": "make lab",
    "mypy": "make lint",
    "pytest-xdist": "make test, in two processes",
    "ruff": "make lint",
    "setuptools": "make dist",
}


def normal(name: str) -> str:
    """A distribution's name as indexes compare it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def wanted_here() -> set[str]:
    """The names whose markers hold on this system and Python."""
    here = next(
        name
        for name, (system, machine, _) in wheels.SYSTEMS.items()
        if (system, machine) == (sys.platform, platform.machine())
    )
    found = wheels.lines().items()
    return {n for n, (_, marker) in found if wheels.is_wanted(marker, here, sys.version_info[1])}


def sources(folder: str) -> Iterator[str]:
    """The Python code of a folder: its modules, and the code cells of its notebooks."""
    for path in (ROOT / folder).rglob("*.py"):
        yield path.read_text(encoding="utf-8")
    for path in (ROOT / folder).rglob("*.ipynb"):
        for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
            if cell["cell_type"] == "code":
                lines = "".join(cell["source"]).splitlines()
                yield "\n".join(line for line in lines if not line.startswith(("%", "!")))


@cache
def distributions(folder: str) -> set[str]:
    """The distributions that a folder's code imports from."""
    names = set()
    for source in sources(folder):
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.Import):
                names |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                names.add(node.module.split(".")[0])
            elif isinstance(node, ast.Call) and ast.unparse(node.func) == "pytest.importorskip":
                names.add(node.args[0].value.split(".")[0])
    beside = {path.stem for path in (ROOT / folder).rglob("*.py")}  # tests import their helpers
    names -= sys.stdlib_module_names | OWN | WITH_PYTHON | (beside - DISTRIBUTIONS.keys())
    return {normal(DISTRIBUTIONS.get(name, [name])[0]) for name in names}  # or not installed


def test_each_library_is_named_once_and_pinned():
    extras = {name: EXTRAS[name] for name in EXTRAS.keys() - {*OF_THE_PACKAGE, *ASIDE}}
    for extra in ON_DEMAND:
        assert all("==" in library for library in extras.pop(extra)), f"{extra} is not pinned"
    engines = [line.partition("; ") for line in extras.pop("physics")]
    named = [*LOWEST, *(name for extra in extras.values() for name in extra)]
    assert all(name == normal(name) for name in named), "extras are names only"
    assert sorted(named) == sorted(PINNED)
    # The reference where environment.txt has it, the other one elsewhere.
    assert [name for name, *_ in engines] == extras["mujoco"] + extras["pybullet"]
    there = engines[1][2].replace("'", '"')
    assert there == wheels.lines()["pybullet"][1]
    opposite = there.replace("==", "!=").replace("<", ">=").replace(" and ", " or ")
    assert engines[0][2].replace("'", '"') == opposite


def test_each_line_has_a_wheel_for_each_system_and_python():
    assert not [*wheels.holes()]


def test_a_line_without_a_wheel_is_found(monkeypatch):
    """PyBullet has one for one system and Python only, and a version that is new has none yet."""
    there = wheels.lines()
    version, marker = there["pybullet"]
    fuller = there | {"pybullet": (version, ""), "numpy": ("99.0", "")}
    monkeypatch.setattr(wheels, "lines", lambda: fuller)
    found = [*wheels.holes()]
    assert len(found) == 2 * len(wheels.SYSTEMS) * len(wheels.PYTHONS) - 1
    assert ("pybullet", "Linux x86-64", 11) not in found and ("numpy", "Windows", 13) in found


def test_what_is_pinned_is_not_below_the_lowest_version():
    for name, lowest in LOWEST.items():
        parts = [[int(part) for part in each.split(".")] for each in (lowest, PINNED[name])]
        assert parts[0] <= parts[1], name


def test_what_is_installed_is_what_is_pinned():
    """PyTorch's version may have a suffix that names its build, such as +cpu."""
    found = {name: version(name).split("+")[0] for name in wanted_here()}
    assert found == {name: each for name, each in PINNED.items() if name in found}


def test_what_is_imported_is_named():
    engines = {*EXTRAS["pybullet"], *EXTRAS["mujoco"]}
    assert distributions("unload") == set(LOWEST) | engines
    assert set(EXTRAS["studies"]) <= distributions("studies")
    found = set().union(*map(distributions, ("unload", "studies", "tests", "notebooks")))
    on_demand = {library.split("==")[0] for extra in ON_DEMAND for library in EXTRAS[extra]}
    assert found - on_demand | set(RUN_ONLY) == set(PINNED)
