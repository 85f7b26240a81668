"""The wheels of the lines of environment.txt, as a registry lists them: kept in wheels.txt.

    python tests/wheels.py

asks pip, for each system and each Python, which wheel it would take for each line. A line without
one is left out there, and ``holes`` finds it.
"""

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

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
PIP_PLATFORMS = {
    "Linux x86-64": [f"manylinux_2_{minor}_x86_64" for minor in range(5, 29)]
    + [f"manylinux{name}_x86_64" for name in (1, 2010, 2014)],
    "Linux ARM": [f"manylinux_2_{minor}_aarch64" for minor in range(17, 29)]
    + ["manylinux2014_aarch64"],
    "macOS ARM": ["macosx_14_0_arm64"],
    "Windows": ["win_amd64"],
}


def lines() -> dict[str, tuple[str, str]]:
    """Version and marker of each line of environment.txt, by name."""
    text = (ROOT / "environment.txt").read_text(encoding="utf-8")
    found = re.findall(r"^([\w.-]+)==([^;\s]+)(?:; (.*))?$", text, re.MULTILINE)
    return {name: (version, marker) for name, version, marker in found}


def is_wanted(marker: str, system: str, minor: int) -> bool:
    """Whether a marker lets a line be installed."""
    platform, machine, _ = SYSTEMS[system]
    values = {"sys_platform": platform, "platform_machine": machine}
    for name, operator, value in re.findall(r'(\w+) (==|<) "([\w.]+)"', marker):
        if operator == "<":
            allowed = minor < int(value.removeprefix("3."))
        else:
            allowed = values[name] == value
        if not allowed:
            return False
    return True


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


def ask(system: str, minor: int) -> set[str]:
    """The wheels that pip would take."""
    found = set()
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--dry-run", "--no-deps"]
    pip += ["--ignore-installed", "--only-binary=:all:", f"--python-version=3.{minor}"]
    pip += [f"--platform={name}" for name in PIP_PLATFORMS[system]]
    wanted = [
        f"{name}=={version}"
        for name, (version, marker) in lines().items()
        if is_wanted(marker, system, minor)
    ]
    with TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        more = [f"--target={folder}", f"--report={report}"]
        for group in (wanted, *([each] for each in wanted)):  # one by one if one has none
            done = subprocess.run([*pip, *more, *group], capture_output=True)
            if not done.returncode:
                entries = json.loads(report.read_text(encoding="utf-8"))["install"]
                urls = (entry["download_info"]["url"] for entry in entries)
                # A build of its own, such as +cpu, stands for the ordinary one.
                found |= {re.sub(r"(%2B|\+)\w+", "", url.rpartition("/")[2]) for url in urls}
                if group is wanted:
                    break
    return found


if __name__ == "__main__":
    wheels: set[str] = set()
    for system, minor in product(SYSTEMS, PYTHONS):
        wheels |= ask(system, minor)
        print(system, minor, len(wheels), flush=True)
    LIST.write_text(
        "".join(f"{wheel}\n" for wheel in sorted(wheels)), encoding="utf-8", newline="\n"
    )
