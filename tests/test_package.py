"""The shape of the house: the order of its rooms, where each library is imported, what is tested.

``unload`` is the package that one installs; ``studies`` stands beside it and uses it.
"""

import ast
import re
import sys
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
TESTS = ROOT / "tests"
PACKAGES = ("unload", "studies")

# The files and folders of the package that may import a library.
LIBRARIES = {
    "PIL": ("drawing/",),
    "filelock": ("support/files.py",),
    "gymnasium": ("__init__.py", "env/", "plain.py", "agent/"),
    "llvmlite": ("fast/kernel.py",),
    "matplotlib": ("drawing/",),
    "mujoco": ("physics/mujoco.py",),
    "numba": ("fast/kernel.py", "support/compiled.py"),
    "numpy": ("",),
    "openpyxl": ("orders/table.py",),
    "pandas": ("orders/", "agent/"),
    "plotly": ("drawing/view.py",),
    "pybullet": ("physics/bullet.py",),
    "safetensors": ("network/weights.py",),
    "torch": ("network/", "fast/", "plain.py", "agent/"),
    "tqdm": ("agent/training.py",),
}


def module_name(path: Path) -> str:
    """Full name of the module or package in a file."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts).removesuffix(".__init__")


MODULES = {
    module_name(path): path
    for package in PACKAGES
    for path in sorted((ROOT / package).rglob("*.py"))
}


@cache
def imported(source: str) -> list[str]:
    """Full names of what code imports: modules, and what it takes from modules."""
    names = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{ast.unparse(node)} is relative"
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    return names


def needs(path: Path) -> set[str]:
    """The modules of both packages that a file imports, without itself."""
    names = imported(path.read_text(encoding="utf-8"))
    ours = (name for name in names if name.split(".")[0] in PACKAGES)
    modules = {name if name in MODULES else name.rpartition(".")[0] for name in ours}
    return modules - ({module_name(path)} if path in MODULES.values() else set())


def room(module: str) -> str:
    """The file or folder of a package that holds a module; "" for the package itself."""
    return ".".join(module.split(".")[1:2]).removeprefix("__main__")


def room_graph(package: str) -> dict[str, set[str]]:
    """The rooms of a package that each of its rooms imports."""
    inside = {name: path for name, path in MODULES.items() if name.split(".")[0] == package}
    graph = {room(module): set() for module in inside if room(module)}
    for module, path in inside.items():
        if room(module):
            graph[room(module)] |= {room(name) for name in needs(path) & inside.keys()}
            graph[room(module)] -= {room(module)}
    return graph


def test_rooms_import_only_those_above_them_in_the_table():
    """The studies have rows, too."""
    graph = room_graph("unload")
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(unload|studies)/(\w+)(?:/|\.py)`", text, re.MULTILINE)
    rooms = [name for package, name in rows if package == "unload"]
    assert sorted(rooms) == sorted(graph) and len(rooms) <= 12
    for place, name in enumerate(rooms):
        assert graph[name] <= {*rooms[:place]}, name
    folders = {path.parent.name for path in (ROOT / "studies").glob("*/*.py")}
    assert sorted(name for package, name in rows if package == "studies") == sorted(folders)


def test_no_imports_run_in_a_circle():
    for graph in (room_graph("studies"), {name: needs(path) for name, path in MODULES.items()}):
        TopologicalSorter(graph).prepare()  # raises an error that names those of a circle


def test_the_package_does_not_know_the_studies():
    """Nor do its tests, except those of the whole house."""
    files = (ROOT / "unload").rglob("*.py")
    texts = (path.read_text(encoding="utf-8") for path in files)
    assert not [text for text in texts if re.search(r"\bstudies\b", text)]
    tests = [path for name in room_graph("unload") for path in (TESTS / name).rglob("*.py")]
    assert not [path for path in tests if "studies" in {name.split(".")[0] for name in needs(path)}]


@pytest.mark.parametrize("package", PACKAGES)
def test_each_room_names_its_files(package):
    """Its ``__init__.py`` gives the order to read them in, and holds no code, ``unload`` aside."""
    folders = {path.parent for path in (ROOT / package).rglob("*.py")}
    if package == "unload":
        folders.remove(ROOT / package)
    for folder in folders:
        tree = ast.parse((folder / "__init__.py").read_text(encoding="utf-8"))
        named = set(re.findall(r"``(\w+)``", ast.get_docstring(tree)))
        there = {path.stem for path in folder.glob("*.py")} - {"__init__"}
        assert there <= named, f"{folder} does not name {sorted(there - named)}"
        registers = folder.name == "heap"
        assert len(tree.body) == (3 if registers else 1), f"{folder} has code"


def test_each_library_is_imported_in_its_places_only():
    used = set()
    for path in (ROOT / "unload").rglob("*.py"):
        place = path.relative_to(ROOT / "unload").as_posix()
        names = {name.split(".")[0] for name in imported(path.read_text(encoding="utf-8"))}
        for library in names - sys.stdlib_module_names - {*PACKAGES}:
            allowed = [start for start in LIBRARIES[library] if place.startswith(start)]
            assert allowed, f"{place} imports {library}; expected in {LIBRARIES[library]}"
            used |= {(library, start) for start in allowed}
    assert used == {(library, start) for library, starts in LIBRARIES.items() for start in starts}


def test_text_is_the_same_on_every_system():
    """In its encoding and line ends; Ruff's rule for encodings sees few of these calls."""
    wanted = {"open": "encoding", "read_text": "encoding", "to_csv": "lineterminator"}
    wanted["write_text"] = "encoding"
    folders = (*PACKAGES, "notebooks", "tests")
    paths = [path for folder in folders for path in (ROOT / folder).rglob("*.py")]
    for path in (*paths, ROOT / "make.py"):
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute):
                owner, name = ast.unparse(call.func.value), call.func.attr
                binary = re.search(r"'[rwax]\+?b'", ast.unparse(call))
                ours = binary or owner in ("Image", "files", "os")
                given = {keyword.arg for keyword in call.keywords}
                assert ours or wanted.get(name) in {None, *given}, ast.unparse(call)


def test_each_test_file_has_its_module_and_each_module_of_the_studies_a_test():
    for path in (path for name in room_graph("unload") for path in (TESTS / name).glob("test_*")):
        module = ROOT / "unload" / path.parent.name / path.name.removeprefix("test_")
        assert module.exists(), f"{path} tests no module"
    tested = set().union(*(needs(path) for path in (TESTS / "studies").rglob("*.py")))
    drawn = {"__init__", "figures"}  # by the notebooks, which test_published.py compares
    code = (path for path in (ROOT / "studies").rglob("*.py") if path.stem not in drawn)
    assert {*map(module_name, code)} <= tested
