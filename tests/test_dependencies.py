"""The libraries: named in pyproject.toml, pinned in environment.txt, and imported somewhere."""

import json
import re
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from importlib.metadata import packages_distributions, version

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tests import wheels
from tests.test_package import imported
from tests.wheels import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
# What loads and orders need, and what the rest of the package does.
OF_THE_PACKAGE = ("train", "view")
EXTRAS = PROJECT["optional-dependencies"]
NEEDED = [*PROJECT["dependencies"], *(name for extra in OF_THE_PACKAGE for name in EXTRAS[extra])]
LOWEST = {line.name: line.specifier for line in map(Requirement, NEEDED)}  # versions
PINNED = {name: str(line.specifier)[2:] for name, line in wheels.lines().items()}
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
        skipped_without = re.findall(r'pytest\.importorskip\("(\w+)', source)
        names |= {name.split(".")[0] for name in [*imported(source), *skipped_without]}
    beside = {path.stem for path in (ROOT / folder).rglob("*.py")}  # tests import their helpers
    names -= sys.stdlib_module_names | OWN | WITH_PYTHON | (beside - DISTRIBUTIONS.keys())
    return {canonicalize_name(DISTRIBUTIONS.get(name, [name])[0]) for name in names}  # or missing


def test_each_library_is_named_once_and_pinned():
    extras = {name: EXTRAS[name] for name in EXTRAS.keys() - {*OF_THE_PACKAGE, *ASIDE}}
    for extra in ON_DEMAND:
        assert all("==" in library for library in extras.pop(extra)), f"{extra} is not pinned"
    engines = [Requirement(line) for line in extras.pop("physics")]
    named = [*LOWEST, *(name for extra in extras.values() for name in extra)]
    assert all(name == canonicalize_name(name) for name in named), "extras are names only"
    assert sorted(named) == sorted(PINNED)
    # The reference where environment.txt has it, the other one elsewhere.
    assert [line.name for line in engines] == extras["mujoco"] + extras["pybullet"]
    other, there = (str(line.marker) for line in engines)
    assert there == str(wheels.lines()["pybullet"].marker)
    assert other == there.replace("==", "!=").replace("<", ">=").replace(" and ", " or ")


def test_each_line_has_a_wheel_for_each_system_and_python():
    assert not [*wheels.holes()]


def test_a_line_without_a_wheel_is_found(monkeypatch):
    """PyBullet has one for one system and Python only, and a version that is new has none yet."""
    new = [f"pybullet=={PINNED['pybullet']}", "numpy==99.0"]
    fuller = wheels.lines() | dict(zip(("pybullet", "numpy"), map(Requirement, new)))
    monkeypatch.setattr(wheels, "lines", lambda: fuller)
    found = [*wheels.holes()]
    assert len(found) == 2 * len(wheels.SYSTEMS) * len(wheels.PYTHONS) - 1
    assert ("pybullet", "Linux x86-64", 11) not in found and ("numpy", "Windows", 13) in found


def test_what_is_pinned_is_not_below_the_lowest_version():
    assert not [name for name in LOWEST if PINNED[name] not in LOWEST[name]]


def test_what_is_installed_is_what_is_pinned():
    """PyTorch's version may have a suffix that names its build, such as +cpu."""
    here = [n for n, line in wheels.lines().items() if not line.marker or line.marker.evaluate()]
    found = {name: version(name).split("+")[0] for name in here}
    assert found == {name: each for name, each in PINNED.items() if name in found}


def test_what_is_imported_is_named():
    engines = {*EXTRAS["pybullet"], *EXTRAS["mujoco"]}
    assert distributions("unload") == set(LOWEST) | engines
    assert set(EXTRAS["studies"]) <= distributions("studies")
    found = set().union(*map(distributions, ("unload", "studies", "tests", "notebooks")))
    on_demand = {library.split("==")[0] for extra in ON_DEMAND for library in EXTRAS[extra]}
    assert found - on_demand | set(RUN_ONLY) == set(PINNED)
