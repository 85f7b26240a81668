"""The libraries: named in pyproject.toml, pinned in environment.txt, and imported somewhere."""

import json
import os
import re
import tomllib
from importlib.metadata import packages_distributions, requires, version
from itertools import product

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


def locked() -> list[Requirement]:
    """The lines of environment.lock."""
    text = (ROOT / "environment.lock").read_text(encoding="utf-8").splitlines()
    return [Requirement(line) for line in text if not line.startswith("#")]


def pinned_for(lines: list[Requirement], system: str, minor: int) -> dict[str, str]:
    """The versions that are pinned for a system and a Python 3.x, by name."""
    place = dict(zip(("sys_platform", "platform_machine"), wheels.SYSTEMS[system]))
    place["os_name"] = "nt" if system == "Windows" else "posix"
    place |= {"python_version": f"3.{minor}", "python_full_version": f"3.{minor}.9"}
    found = [line for line in lines if not line.marker or line.marker.evaluate(place)]
    names = [canonicalize_name(line.name) for line in found]
    assert len(names) == len({*names})
    return {name: str(line.specifier)[2:] for name, line in zip(names, found)}


def test_the_lock_agrees_with_what_it_is_made_of():
    """If not: ``make lock``. Also in the packages that only some systems and Pythons need."""
    own = [*wheels.lines().values()]
    extras = [Requirement(line) for extra in ON_DEMAND for line in EXTRAS[extra]]
    for system, minor in product(wheels.SYSTEMS, wheels.PYTHONS):
        wanted = pinned_for([*own, *extras], system, minor)
        found = pinned_for(locked(), system, minor)
        assert wanted.items() <= found.items() and len(found) > 3 * len(wanted)
        assert ("pybullet" in found) == ("pybullet" in wanted)


def test_what_is_installed_is_what_the_lock_says():
    """All that environment.txt names here, and all that this needs in turn.

    PyTorch's version may have a suffix that names its build, such as +cpu.
    """
    locks = {line.name: line for line in locked() if not line.marker or line.marker.evaluate()}
    names, found = [n for n, line in wheels.lines().items() if n in locks], {}
    for name in names:  # which grows meanwhile
        if name not in found:
            found[name] = version(name).split("+")[0]
            for line in map(Requirement, requires(name) or []):
                if not line.marker or line.marker.evaluate({"extra": ""}):
                    names.append(canonicalize_name(line.name))
    assert found == {name: str(locks[name].specifier)[2:] for name in found}
    assert len(found) > 2 * len(wheels.lines())


def test_machines_that_others_lend_install_the_same():
    """Binder, and what ``.devcontainer`` describes: on the Python that PyBullet has a wheel for."""
    text = (ROOT / ".binder/requirements.txt").read_text(encoding="utf-8")
    named = re.findall(r"^--(?:requirement|constraint) (.+)", text, re.M)
    files = [(ROOT / ".binder" / name).resolve() for name in named]
    assert files == [ROOT / "environment.txt", ROOT / "environment.lock"]
    assert (ROOT / ".binder/runtime.txt").read_text(encoding="utf-8") == "python-3.11\n"
    assert os.name == "nt" or os.access(ROOT / ".binder/postBuild", os.X_OK)
    device = (ROOT / ".devcontainer/devcontainer.json").read_text(encoding="utf-8")
    assert json.loads(device)["image"].startswith("python:3.11-")


def test_what_is_imported_is_named():
    engines = {*EXTRAS["pybullet"], *EXTRAS["mujoco"]}
    names = {name: DISTRIBUTIONS.get(name, [name])[0] for name in LIBRARIES}  # or not here
    assert {canonicalize_name(name) for name in names.values()} == set(LOWEST) | engines
    assert set(EXTRAS["studies"]) <= imported("studies")
    found = set().union(*map(imported, ("unload", "studies", "tests", "notebooks")))
    on_demand = {library.split("==")[0] for extra in ON_DEMAND for library in EXTRAS[extra]}
    assert found - on_demand | engines | set(RUN_ONLY) == set(PINNED)
