"""The libraries: named in pyproject.toml, pinned in environment.txt, and imported somewhere."""

import re
import tomllib
from importlib.metadata import packages_distributions, version

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tests import wheels
from tests.test_package import LIBRARIES
from tests.wheels import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
# What the package imports besides what loads and orders need.
OF_THE_PACKAGE = ("train", "view", "excel")
EXTRAS = PROJECT["optional-dependencies"]
NEEDED = [*PROJECT["dependencies"], *(name for extra in OF_THE_PACKAGE for name in EXTRAS[extra])]
LOWEST = {line.name: line.specifier for line in map(Requirement, NEEDED)}  # versions
PINNED = {name: str(line.specifier)[2:] for name, line in wheels.lines().items()}
DISTRIBUTIONS = packages_distributions()  # by the names that are imported
# Extras for one command each, pinned in pyproject.toml.
ON_DEMAND = ("book", "browser")
# An extra of the package that nothing here needs.
ASIDE = ("video",)
# Named, but imported by no statement, and what for.
RUN_ONLY = {
    "dask": "joblib's backend for a cluster",
    "ipykernel": "runs the notebooks",
    "jupyterlab": "make lab",
    "mypy": "make lint",
    "pytest-xdist": "make test, on all cores",
    "ruff": "make lint",
    "setuptools": "make dist",
}


def imported(folder: str) -> set[str]:
    """The distributions that a folder imports from, in modules and in cells of notebooks."""
    paths = [path for kind in ("py", "ipynb") for path in (ROOT / folder).rglob(f"*.{kind}")]
    text = "\n".join(path.read_text(encoding="utf-8") for path in paths)
    names = re.findall(r'^[ "]*(?:import|from) (\w+)', text, re.M)
    names += re.findall(r'importorskip\("(\w+)', text)
    known = DISTRIBUTIONS.keys() & {*names}
    return {canonicalize_name(DISTRIBUTIONS[name][0]) for name in known} - {"unload", "pip"}


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


def test_each_line_has_a_wheel_for_each_system_and_python(monkeypatch):
    assert not [*wheels.holes()]
    monkeypatch.setattr(wheels, "lines", lambda: {"numpy": Requirement("numpy==99.0")})
    assert len([*wheels.holes()]) == len(wheels.SYSTEMS) * len(wheels.PYTHONS)


def test_what_is_pinned_is_not_below_the_lowest_version():
    assert not [name for name in LOWEST if PINNED[name] not in LOWEST[name]]


def test_what_is_installed_is_what_is_pinned():
    """PyTorch's version may have a suffix that names its build, such as +cpu."""
    here = [n for n, line in wheels.lines().items() if not line.marker or line.marker.evaluate()]
    found = {name: version(name).split("+")[0] for name in here}
    assert found == {name: each for name, each in PINNED.items() if name in found}


def test_what_is_imported_is_named():
    engines = {*EXTRAS["pybullet"], *EXTRAS["mujoco"]}
    names = {name: DISTRIBUTIONS.get(name, [name])[0] for name in LIBRARIES}  # or not here
    assert {canonicalize_name(name) for name in names.values()} == set(LOWEST) | engines
    assert set(EXTRAS["studies"]) <= imported("studies")
    found = set().union(*map(imported, ("unload", "studies", "tests", "notebooks")))
    on_demand = {library.split("==")[0] for extra in ON_DEMAND for library in EXTRAS[extra]}
    assert found - on_demand | engines | set(RUN_ONLY) == set(PINNED)
