"""The wheels of the lines of environment.txt, as a registry lists them: kept in wheels.txt.

    python tests/wheels.py

asks for them anew. ``holes`` finds the lines that have none for a system and a Python.
"""

import re
from collections.abc import Iterator
from itertools import product
from pathlib import Path

from pip._vendor.packaging.markers import Marker

ROOT = Path(__file__).resolve().parents[1]
LIST = Path(__file__).with_name("wheels.txt")
PYTHONS = (11, 12, 13, 14)  # 3.x
# By system: what ``sys.platform`` and ``platform.machine()`` say there, and the names that wheels
# for it or for older ones have: glibc 2.28, macOS 14, Windows of 64 bits.
SYSTEMS = {
    "Linux x86-64": ("linux", "x86_64", r"(many)?linux(_2_\d|_2_1\d|_2_2[0-8]|1|2010|2014)_x86_64"),
    "Linux ARM": ("linux", "aarch64", r"(many)?linux(_2_1\d|_2_2[0-8]|2014)_aarch64"),
    "macOS ARM": ("darwin", "arm64", r"macosx_(10|11|12|13|14)_\d+_(arm64|universal2)"),
    "Windows": ("win32", "AMD64", r"win_amd64"),
}


def lines() -> dict[str, tuple[str, str]]:
    """Version and marker of each line of environment.txt, by name."""
    text = (ROOT / "environment.txt").read_text(encoding="utf-8")
    found = re.findall(r"^([\w.-]+)==([^;\s]+)(?:; (.*))?$", text, re.MULTILINE)
    return {name: (version, marker) for name, version, marker in found}


def is_wanted(marker: str, system: str, minor: int) -> bool:
    """Whether a marker lets a line be installed."""
    platform, machine, _ = SYSTEMS[system]
    place = {"sys_platform": platform, "platform_machine": machine}
    return not marker or Marker(marker).evaluate(place | {"python_version": f"3.{minor}"})


def fits(wheel: str, system: str, minor: int) -> bool:
    """Whether a wheel can be installed, by its file's name."""
    *_, pythons, abis, platforms = wheel.removesuffix(".whl").split("-")
    stable = "abi3" in abis.split(".")
    versions = [int(tag[3:]) for tag in pythons.split(".") if re.fullmatch(r"cp3\d+", tag)]
    right_python = "py3" in pythons.split(".") or any(
        (minor == version and not abis.endswith("t")) or (stable and version < minor)
        for version in versions
    )
    names = rf"any|{SYSTEMS[system][2]}"
    return right_python and any(re.fullmatch(names, name) for name in platforms.split("."))


def holes() -> Iterator[tuple[str, str, int]]:
    """The lines, systems and Pythons 3.x for which ``LIST`` lacks a wheel."""
    wheels = LIST.read_text(encoding="utf-8").splitlines()
    for (name, (version, marker)), system, minor in product(lines().items(), SYSTEMS, PYTHONS):
        start = f"{name.replace('-', '_')}-{version}-".lower()
        own = [wheel for wheel in wheels if wheel.lower().startswith(start)]
        if is_wanted(marker, system, minor) and not any(fits(each, system, minor) for each in own):
            yield name, system, minor


def listed(name: str, version: str) -> list[str]:
    """The wheels of a version that fit a system and a Python of ours, as the registry has them."""
    # Of pip itself, which knows where to ask; its commands list versions, but no files.
    from pip._internal.index import collector
    from pip._internal.models.index import PyPI
    from pip._internal.network.session import PipSession

    page = collector._get_simple_response(f"{PyPI.simple_url}/{name}/", PipSession(retries=3))
    content = collector._make_index_content(page, cache_link_parsing=False)
    start = f"{name.replace('-', '_')}-{version}-".lower()
    wheels = {link.filename for link in collector.parse_links(content)}
    return [
        wheel
        for wheel in sorted(wheels)
        if wheel.lower().startswith(start)
        and wheel.endswith(".whl")
        and any(fits(wheel, *place) for place in product(SYSTEMS, PYTHONS))
    ]


if __name__ == "__main__":
    found = [wheel for name, (version, _) in lines().items() for wheel in listed(name, version)]
    LIST.write_text("".join(f"{wheel}\n" for wheel in found), encoding="utf-8", newline="\n")
