"""The shape of the package: what imports what."""

import ast
import re
from pathlib import Path

import unload
from unload.support import files

FILES = sorted(Path(unload.__file__).parent.rglob("*.py"))


def imported(path):
    """Full names of the modules that a file imports."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def importers(library):
    return {
        path.stem for path in FILES if any(name.split(".")[0] == library for name in imported(path))
    }


def test_each_library_has_its_rooms():
    assert importers("pybullet") == {"bullet"}
    assert importers("plotly") == {"view"}
    assert importers("torch") == {
        "agent", "architectures", "fused", "mixed_picks", "network", "offline", "sweep", "train"
    }  # fmt: skip
    in_figures = {path.stem for path in FILES if path.parent.name == "figures"}
    assert importers("matplotlib") <= in_figures


def test_imports_run_one_way():
    """In the order that the README gives: a module imports only those after it."""
    modules = {path.stem: path for path in FILES if path.parent.name == "unload"}
    del modules["__init__"]
    (line,) = (
        line for line in (files.ROOT / "README.md").read_text().splitlines()
        if line.startswith("| `unload/` |")
    )  # fmt: skip
    _, *order = re.findall(r"`(\w+)/?`", line)
    assert sorted(order) == sorted([*modules, "figures"])
    for place, name in enumerate(order[1:], 1):
        needs = {part for target in imported(modules[name]) for part in target.split(".")}
        assert not needs & set(order[:place]), name
