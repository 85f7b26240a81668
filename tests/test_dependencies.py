"""The libraries: named in pyproject.toml, pinned in environment.txt, and imported somewhere."""

import ast
import json
import re
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from importlib.metadata import packages_distributions, version
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
# What loads and orders need, and what the rest of the package does.
OF_THE_PACKAGE = ("train", "view")
EXTRAS = PROJECT["optional-dependencies"]
NEEDED = [*PROJECT["dependencies"], *(name for extra in OF_THE_PACKAGE for name in EXTRAS[extra])]
LOWEST = dict(library.split(">=") for library in NEEDED)  # versions by name
DISTRIBUTIONS = packages_distributions()  # by the names that are imported
OWN = {"notebooks", "studies", "tests", "unload"}
# Extras for one command each, pinned in pyproject.toml.
ON_DEMAND = ("book", "browser")
# Extras of the package that nothing here needs.
ASIDE = ("excel", "video")
# Imported by tests that are skipped where they are not installed.
SKIPPED = {"mujoco"}
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


def pinned() -> dict[str, str]:
    """Versions by name, as environment.txt gives them."""
    lines = (ROOT / "environment.txt").read_text().splitlines()
    return dict(line.split("==") for line in lines if line and not line.startswith("#"))


def sources(folder: str) -> Iterator[str]:
    """The Python code of a folder: its modules, and the code cells of its notebooks."""
    for path in (ROOT / folder).rglob("*.py"):
        yield path.read_text()
    for path in (ROOT / folder).rglob("*.ipynb"):
        for cell in json.loads(path.read_text())["cells"]:
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
    names -= sys.stdlib_module_names | OWN | (beside - DISTRIBUTIONS.keys())
    return {normal(DISTRIBUTIONS.get(name, [name])[0]) for name in names}  # or not installed


def on_demand() -> set[str]:
    """The names of the libraries that make targets of their own install."""
    return {library.split("==")[0] for extra in ON_DEMAND for library in EXTRAS[extra]}


def test_each_library_is_named_once_and_pinned():
    extras = {name: EXTRAS[name] for name in EXTRAS.keys() - {*OF_THE_PACKAGE, *ASIDE}}
    for extra in ON_DEMAND:
        assert all("==" in library for library in extras.pop(extra)), f"{extra} is not pinned"
    named = [*LOWEST, *(name for extra in extras.values() for name in extra)]
    assert all(name == normal(name) for name in named), "extras are names only"
    assert sorted(named) == sorted(pinned())


def test_what_is_pinned_is_not_below_the_lowest_version():
    for name, lowest in LOWEST.items():
        parts = [[int(part) for part in each.split(".")] for each in (lowest, pinned()[name])]
        assert parts[0] <= parts[1], name


def test_what_is_installed_is_what_is_pinned():
    """PyTorch's version may have a suffix that names its build, such as +cpu."""
    assert {name: version(name).split("+")[0] for name in pinned()} == pinned()


def test_what_is_imported_is_named():
    assert distributions("unload") == set(LOWEST) | {*EXTRAS["pybullet"]}
    others = distributions("studies") - on_demand()
    assert set(EXTRAS["studies"]) <= others
    others |= (distributions("tests") | distributions("notebooks")) - on_demand()
    assert SKIPPED <= others
    others -= SKIPPED
    assert distributions("unload") | others | set(RUN_ONLY) == set(pinned())
