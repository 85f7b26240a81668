"""The shape of the package: what imports what."""

import ast
from pathlib import Path

import unload

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
        "agent", "architectures", "fused", "network", "offline", "sweep", "train"
    }  # fmt: skip
    in_figures = {path.stem for path in FILES if path.parent.name == "figures"}
    assert importers("matplotlib") <= in_figures


def test_imports_run_one_way():
    """No module imports itself by way of others."""
    modules = {path.stem: path for path in FILES if path.parent.name == "unload"}
    del modules["__init__"]
    below = {
        name: {part for target in imported(path) for part in target.split(".")} & modules.keys()
        for name, path in modules.items()
    }
    below = {name: needs - {name} for name, needs in below.items()}
    while below:
        ground = {name for name, needs in below.items() if not needs & below.keys()}
        assert ground, f"a circle among {sorted(below)}"
        below = {name: needs for name, needs in below.items() if name not in ground}
