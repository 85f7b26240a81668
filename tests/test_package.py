"""The shape of the package: the order of its rooms, and where each library is imported."""

import ast
import re
import sys
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "unload"
TESTS = ROOT / "tests"
README = (ROOT / "README.md").read_text()

# The files and folders of unload/ that may import a library; "" stands for all.
LIBRARIES = {
    "PIL": ("load/view.py", "reproduce/paper/animation.py"),
    "anywidget": ("play/canvas.py",),
    "gymnasium": ("__init__.py", "env/", "agent/", "heap/", "reproduce/"),
    "ipywidgets": ("play/",),
    "joblib": ("agent/sweep.py", "reproduce/"),
    "llvmlite": ("agent/fast/kernel.py", "support/compiled.py"),
    "matplotlib": ("load/view.py", "heap/study/", "reproduce/"),
    "numba": ("support/compiled.py", "agent/fast/kernel.py"),
    "numpy": ("",),
    "pandas": ("load/packing_list.py", "agent/", "heap/study/", "reproduce/"),
    "plotly": ("load/view.py", "play/replay.py"),
    "pybullet": ("physics/bullet.py",),
    "safetensors": ("network/weights.py",),
    "scipy": ("heap/", "reproduce/"),
    "stable_baselines3": ("env/sb3.py",),
    "torch": ("network/", "agent/", "heap/", "reproduce/"),
    "tqdm": ("agent/", "reproduce/"),
    "traitlets": ("play/canvas.py",),
}
# Modules that have no test file of their own, and the file in tests/ that covers them.
COVERED_BY = {
    "__main__.py": "agent/test_order.py",
    "agent/fast/kernel.py": "agent/fast/test_fused.py",  # its loops
    "reproduce/falls/figures.py": "reproduce/test_figures.py",
    "reproduce/lifts/figures.py": "reproduce/test_figures.py",
    "reproduce/paper/figures.py": "reproduce/test_figures.py",
    "reproduce/paper/diagrams.py": "reproduce/test_figures.py",
    "reproduce/policies/speed.py": "reproduce/policies/test_figures.py",
    "reproduce/style.py": "reproduce/test_figures.py",
}


def module_name(path: Path) -> str:
    """Full name of the module or package in a file."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts).removesuffix(".__init__")


MODULES = {module_name(path): path for path in sorted(PACKAGE.rglob("*.py"))}


@cache
def imported(path: Path) -> list[str]:
    """Full names of what a file imports: modules, and what it takes from modules."""
    names = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{path} has a relative import"
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    return names


def needs(path: Path) -> set[str]:
    """The package's modules that a file imports, without itself."""
    ours = (name for name in imported(path) if name.split(".")[0] == "unload")
    modules = {name if name in MODULES else name.rpartition(".")[0] for name in ours}
    return modules - {module_name(path)}


def libraries(path: Path) -> set[str]:
    """The libraries of others that a file imports."""
    return {name.split(".")[0] for name in imported(path)} - sys.stdlib_module_names - {"unload"}


def room(module: str) -> str:
    """The file or folder of unload/ that holds a module; "" for unload itself.

    The study of heaps counts with ``reproduce``, so that ``heap/`` can be removed as one folder.
    """
    if module.startswith("studies.heap"):
        return "reproduce"
    return ".".join(module.split(".")[1:2]).removeprefix("__main__")  # which is unload's own, too


def levels(graph: dict[str, set[str]]) -> list[list[str]]:
    """Sort a graph's nodes so that each needs only those of earlier levels."""
    left, sorted_levels = dict(graph), []
    while left:
        level = sorted(node for node, wanted in left.items() if not wanted & left.keys())
        assert level, f"imports run in a circle among {sorted(left)}"
        sorted_levels.append(level)
        for node in level:
            del left[node]
    return sorted_levels


def room_graph() -> dict[str, set[str]]:
    """The rooms that each room imports."""
    graph = {room(module): set() for module in MODULES if room(module)}
    for module, path in MODULES.items():
        if room(module):
            graph[room(module)] |= {room(needed) for needed in needs(path)} - {room(module)}
    return graph


def test_rooms_are_in_the_order_that_the_readme_gives():
    ordered = levels(room_graph())
    assert len(ordered) <= 7
    sentence = " < ".join(", ".join(f"`{name}`" for name in level) for level in ordered)
    assert f"run one way: {sentence}" in README.replace("\n", " "), sentence


def test_no_module_imports_itself_through_others():
    levels({module: needs(path) for module, path in MODULES.items()})


def test_only_the_top_imports_the_top():
    graph = room_graph()
    users = {name: {user for user, needed in graph.items() if name in needed} for name in graph}
    assert not users["reproduce"]
    assert users.get("heap", set()) <= {"reproduce"}
    assert not users["play"]
    of_reproduce = [path for path in MODULES.values() if "reproduce" in path.parts]
    assert not any(name.startswith("studies.heap") for path in of_reproduce for name in needs(path))
    imported_first = {room(module) for module in needs(PACKAGE / "__init__.py")}
    assert not imported_first & {"reproduce", "heap", "play"}


def test_the_package_has_few_rooms():
    others = {"__init__.py", "__main__.py", "__pycache__", "data", "py.typed"}
    assert len({path.name for path in PACKAGE.iterdir()} - others) <= 10


def test_each_room_names_its_files():
    """Its ``__init__.py`` holds a docstring, which gives the order to read them in, and no code."""
    for path in PACKAGE.rglob("*/__init__.py"):
        tree = ast.parse(path.read_text())
        assert len(tree.body) == 1 and ast.get_docstring(tree), f"{path} is not a docstring"
        named = set(re.findall(r"``(\w+)``", ast.get_docstring(tree)))
        files = {each.stem for each in path.parent.glob("*.py")} - {"__init__"}
        assert files <= named, f"{path} does not name {sorted(files - named)}"


def test_the_reference_describes_each_module():
    for page in (ROOT / "notebooks/book/reference").glob("*.md"):
        if page.stem == "index":
            continue
        described = re.findall(r"automodule:: (\S+)", page.read_text())
        folder = PACKAGE / page.stem
        there = {module_name(path) for path in folder.glob("*.py")} - {f"unload.{page.stem}"}
        assert set(described) == there and len(described) == len(there), page.name


def test_the_way_to_contribute_has_a_row_for_each_room():
    lines = (ROOT / "CONTRIBUTING.md").read_text().splitlines()
    rows = [line.split("`")[1] for line in lines if line.startswith("| `unload/")]
    rooms = [name for level in levels(room_graph()) for name in level]
    assert [row.strip("/").removeprefix("unload/").removesuffix(".py") for row in rows] == rooms


def test_each_library_is_imported_in_its_places_only():
    used = set()
    for path in MODULES.values():
        place = path.relative_to(PACKAGE).as_posix()
        for library in libraries(path):
            allowed = [start for start in LIBRARIES[library] if place.startswith(start)]
            assert allowed, f"{place} imports {library}; expected in {LIBRARIES[library]}"
            used |= {(library, start) for start in allowed}
    assert used == {(library, start) for library, starts in LIBRARIES.items() for start in starts}


def test_each_module_with_code_has_its_test_file():
    """A module of constants has nothing to test; the package's own is in test_installed.py."""
    tests = {path.relative_to(TESTS).as_posix() for path in TESTS.glob("*/**/test_*.py")}
    covering = {}
    for path in set(MODULES.values()) - {PACKAGE / "__init__.py"}:
        kinds = {type(node) for node in ast.walk(ast.parse(path.read_text()))}
        if kinds & {ast.FunctionDef, ast.ClassDef}:
            place = path.relative_to(PACKAGE)
            mirror = (place.parent / f"test_{place.stem.strip('_')}.py").as_posix()
            name = place.as_posix()
            covering[name] = mirror if mirror in tests else COVERED_BY.get(name)
    assert not [module for module, test in covering.items() if test not in tests]
    assert set(COVERED_BY) <= {m for m, test in covering.items() if test == COVERED_BY.get(m)}
    assert tests == set(covering.values()), "each test file has its module"
