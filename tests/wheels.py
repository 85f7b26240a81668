"""The wheels of the lines of environment.txt, as the registry lists them: kept in wheels.txt.

    python tests/wheels.py

asks for them anew. ``holes`` finds the lines that have none for a system and a Python.
"""

import json
from collections.abc import Iterator
from functools import cache
from itertools import product
from pathlib import Path
from urllib.request import Request, urlopen

from packaging import tags
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name, parse_wheel_filename

ROOT = Path(__file__).resolve().parents[1]
LIST = Path(__file__).with_name("wheels.txt")
PYTHONS = (11, 12, 13, 14)  # 3.x
MANYLINUX = ("1", "2010", "2014", *(f"_2_{minor}" for minor in range(5, 29)))
# By system: what ``sys.platform`` and ``platform.machine()`` say there, and the platforms of wheels
# for it or for older ones: glibc 2.28, macOS 14, Windows of 64 bits.
SYSTEMS = {
    "Linux x86-64": ("linux", "x86_64", [f"manylinux{libc}_x86_64" for libc in MANYLINUX]),
    "Linux ARM": ("linux", "aarch64", [f"manylinux{libc}_aarch64" for libc in MANYLINUX]),
    "macOS ARM": ("darwin", "arm64", [*tags.mac_platforms((14, 0), "arm64")]),
    "Windows": ("win32", "AMD64", ["win_amd64"]),
}


def lines() -> dict[str, Requirement]:
    """The lines of environment.txt by name."""
    text = (ROOT / "environment.txt").read_text(encoding="utf-8").splitlines()
    found = [Requirement(line) for line in text if line and not line.startswith("#")]
    return {line.name: line for line in found}


@cache
def supported(system: str, minor: int) -> set[tags.Tag]:
    """The tags of wheels that can be installed."""
    python, abi, platforms = (3, minor), f"cp3{minor}", SYSTEMS[system][2]
    found = {*tags.cpython_tags(python, [abi], platforms)}
    return found | {*tags.compatible_tags(python, abi, platforms)}


def fits(wheel: str, line: Requirement, system: str, minor: int) -> bool:
    """Whether a wheel is a line's and can be installed there, by its file's name."""
    name, version, _, own = parse_wheel_filename(wheel)
    right = name == canonicalize_name(line.name) and version in line.specifier
    return right and not own.isdisjoint(supported(system, minor))


def holes() -> Iterator[tuple[str, str, int]]:
    """The lines, systems and Pythons 3.x for which ``LIST`` lacks a wheel."""
    wheels = LIST.read_text(encoding="utf-8").splitlines()
    for line, system, minor in product(lines().values(), SYSTEMS, PYTHONS):
        place = dict(zip(("sys_platform", "platform_machine"), SYSTEMS[system]))
        wanted = not line.marker or line.marker.evaluate(place | {"python_version": f"3.{minor}"})
        if wanted and not any(fits(wheel, line, system, minor) for wheel in wheels):
            yield line.name, system, minor


def listed(line: Requirement) -> list[str]:
    """The wheels of a line that fit a system and a Python of ours, as the registry has them."""
    form = {"Accept": "application/vnd.pypi.simple.v1+json"}
    with urlopen(Request(f"https://pypi.org/simple/{line.name}/", headers=form)) as answer:
        names = sorted(file["filename"] for file in json.load(answer)["files"])
    version = str(line.specifier).removeprefix("==")
    own = [name for name in names if f"-{version}-" in name and name.endswith(".whl")]
    places = [*product(SYSTEMS, PYTHONS)]
    return [name for name in own if any(fits(name, line, *place) for place in places)]


if __name__ == "__main__":
    found = [wheel for line in lines().values() for wheel in listed(line)]
    LIST.write_text("".join(f"{wheel}\n" for wheel in found), encoding="utf-8", newline="\n")
