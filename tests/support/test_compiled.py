"""Compiled code on disk: used again as long as nothing changes that it was built from."""

import importlib
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import pytest
from numba.core.caching import IndexDataCacheFile

import unload
from unload.support.compiled import fingerprint

PACKAGE = Path(unload.__file__).parent

# Three modules, whose last function uses one value of each kind.
SOURCES = {
    "constants": """
import numpy as np

LIMIT = 1
PAIR = (1, (2.0, "a"))
LEVELS = np.zeros(2000)
SMALL = np.float32(1)
""",
    "called": """
from typing import NamedTuple

from numba.extending import intrinsic

from constants import LIMIT
from unload.support.compiled import compiled


class Point(NamedTuple):
    x: int
    y: int


@intrinsic
def one(typing_context, x):
    def build(context, builder, signature, arguments):
        return context.get_constant(x, 1)

    return x(x), build


def plain(x):
    return x + LIMIT


last = compiled(plain)


@compiled
def step(x, more=1):
    return last(x) + more


@compiled
def first_field(point):
    return point.x
""",
    "function": """
import numpy as np

import constants
from called import Point, first_field, one, step
from constants import LEVELS, PAIR
from unload.support.compiled import compiled


def make(factor):
    @compiled
    def closure(x):
        return factor * x

    return closure


closure = make(2)


@compiled
def function(x):
    if x < constants.LIMIT:
        return 0.0
    total = step(x) + closure(x) + np.float32(PAIR[0]) + constants.SMALL
    return total + LEVELS[0] + one(x) + first_field(Point(x, 0))


@compiled
def of_point(point):
    return point.x
""",
}


@pytest.fixture
def load(tmp_path, monkeypatch):
    """``load(*edits)``: the last of the modules, edited, as a new process would import it."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")

    def load(*edits):
        for name, source in SOURCES.items():
            for old, new in edits:
                source = source.replace(old, new)
            (tmp_path / f"{name}.py").write_text(source)
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        return importlib.import_module("function")

    yield load
    for name in SOURCES:
        sys.modules.pop(name, None)


@pytest.mark.parametrize(
    "edit",
    [
        ("LIMIT = 1", "LIMIT = 2"),
        ('2.0, "a"', '2.5, "a"'),
        ('2.0, "a"', '2.0, "b"'),
        ("np.zeros(2000)", "np.append(np.zeros(1999), 1)"),
        ("np.zeros(2000)", "np.zeros(2000, np.float32)"),
        ("SMALL = np.float32(1)", "SMALL = np.float64(1)"),
        ("more=1", "more=2"),
        ("x + LIMIT", "x - LIMIT"),
        ("compiled(plain)", "compiled(plain, fastmath=True)"),
        ("get_constant(x, 1)", "get_constant(x, 2)"),
        ("    x: int\n    y: int", "    y: int\n    x: int"),
        ("make(2)", "make(3)"),
        ("np.float32(PAIR[0])", "np.float64(PAIR[0])"),
        ("x < constants.LIMIT", "x <= constants.LIMIT"),
    ],
    ids=lambda edit: edit[1],
)
def test_the_fingerprint_changes_with(load, edit):
    assert fingerprint(load(edit).function) != fingerprint(load().function)


def test_the_fingerprint_stays_where_lines_move_and_other_values_change(load):
    edits = ("import numpy as np", "import numpy as np\n\n# A comment.\nOTHER = {1: 2}")
    assert fingerprint(load(edits).function) == fingerprint(load().function)


@pytest.mark.parametrize("version", range(4))
def test_the_fingerprint_changes_with_the_versions(load, version, monkeypatch):
    function = load().function
    before = fingerprint(function)
    versions = [*unload.support.compiled.VERSIONS]
    versions[version] += "1"
    monkeypatch.setattr(unload.support.compiled, "VERSIONS", tuple(versions))
    assert fingerprint(function) != before


def test_unchanged_code_is_loaded(load):
    assert load().function(5) == 25
    function = load().function
    assert function(5) == 25
    assert sum(function.stats.cache_hits.values()) == 1 and not function.stats.cache_misses
    assert load(("LIMIT = 1", "LIMIT = 2")).function(5) == 26
    assert load().function(5) == 25


def test_fields_of_a_named_tuple_that_change_places(load):
    """numba's own cache, too, would return the other field."""
    module = load()
    assert module.of_point(module.Point(x=1, y=2)) == 1
    module = load(("    x: int\n    y: int", "    y: int\n    x: int"))
    assert module.of_point(module.Point(x=1, y=2)) == 1


def test_a_value_that_cannot_be_followed_is_refused(load):
    function = load(("LEVELS = np.zeros(2000)", "LEVELS = {0: 1.0}")).function
    with pytest.raises(TypeError, match=r"function uses \{0: 1.0\}; expected numbers, strings"):
        function(5)


def test_a_save_that_fails_leaves_no_old_code(load, monkeypatch):
    """After the first of two files the disk is full, or the process is killed."""
    module = load()
    assert module.of_point(module.Point(1, 2)) == 1

    def full(*arguments):
        raise OSError("No space left on device")

    module = load(("return point.x", "return point.y"))
    with monkeypatch.context() as patch:
        patch.setattr(IndexDataCacheFile, "_save_data", full)
        with pytest.raises(OSError, match="No space left"):
            module.of_point(module.Point(1, 2))
    module = load(("return point.x", "return point.y"))
    assert module.of_point(module.Point(1, 2)) == 2


def test_a_folder_that_cannot_be_written(load, tmp_path, monkeypatch):
    (tmp_path / "__pycache__").write_text("not a folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "user"))
    assert load().function(5) == 25
    function = load().function
    assert function(5) == 25 and function.stats.cache_path.startswith(str(tmp_path / "user"))
    assert sum(function.stats.cache_hits.values()) == 1


def test_every_compiled_function_is_compiled_so():
    here = PACKAGE / "support" / "compiled.py"
    for path in PACKAGE.rglob("*.py"):
        assert path == here or "njit" not in path.read_text(), f"{path} should use compiled"


# The vector environment is compiled in one file from constants and functions of others.
ANSWERS = """
import json
import numpy as np
from unload.env.fast import containers

def container(*boxes):
    state = containers.allocate(1, len(boxes), 2)
    state.geometry[0], state.present[0] = boxes, True
    return state

def digest(state):
    return int(containers.situation_digest(state, 0, 0, np.empty(4, np.int32)))

alone = digest(container((3, 1, 1, 0.4, 0.4, 0.4)))
stack = container((3, 1, 1, 0.4, 0.4, 0.4), (3, 1, 1.4, 0.4, 0.4, 0.4))
stack.starts[0] = (0, 1, 1), (1, 1, 2), (2, 2, 2)  # above, below, beside
stack.links[0] = 1, 0
full = container(*[(3, 1, 1, 0.4, 0.4, 0.4)] * 130)
full.left[:], full.seen[:], full.by_distance[:] = 130, 0.5, np.arange(130)
full.visible[:], full.values[:] = np.arange(128), 0.5
failed, _ = [
    containers.pick(full, np.zeros(1, int), np.array([moved]), False, False, np.float32(0)) < 0
    for moved in (0.25, 0.35)
]
functions = containers.pick, containers.situation_digest
print(json.dumps({
    "LIFT_THRESHOLD": bool(failed[0]),
    "HELD_DOWN": digest(stack) == 0,
    "RESOLUTION": alone == digest(container((3, 1, 1, 0.4, 0.4, 0.400004))),
    "CONTACT_TOLERANCE": alone != digest(container((3, 1, 0.6, 0.4, 0.4, 0.4))),
    "features": bool((full.observations == 7).all()),
    "hits": sum(sum(one.stats.cache_hits.values()) for one in functions),
    "misses": sum(sum(one.stats.cache_misses.values()) for one in functions),
}))
"""
EDITS = {
    "LIFT_THRESHOLD": "0.3",
    "HELD_DOWN": "1",
    "RESOLUTION": "1e-5",
    "CONTACT_TOLERANCE": "5e-1",
}
EDITED_FUNCTION = """

@compiled
def features(values, ranks, equalize, average, tolerance, observation, items=task.N_VISIBLE):
    observation[:] = 7
"""


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    """What compiled functions of a copy of the package do: at first, again, and after edits."""
    root = tmp_path_factory.mktemp("edited")
    copy = root / "unload"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    (copy / "__init__.py").write_text("")  # PyTorch is not needed, and takes seconds
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    # Python itself takes a file of the same size and time for the same file.
    environment |= {"PYTHONPATH": str(root), "PYTHONDONTWRITEBYTECODE": "1"}

    def run():
        command = [sys.executable, "-c", ANSWERS]
        return json.loads(subprocess.check_output(command, env=environment, cwd=root))

    runs = {"first": run(), "unchanged": run()}
    for name, value in EDITS.items():
        pattern = re.compile(rf"^({name} = )\S+", re.MULTILINE)
        (path,) = (path for path in copy.rglob("*.py") if pattern.search(path.read_text()))
        stat, source = path.stat(), path.read_text()
        edited = pattern.sub(rf"\g<1>{value}", source)
        path.write_text(edited)
        os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))
        assert edited != source and len(edited) == len(source)
    with open(copy / "env" / "fast" / "ranking.py", "a") as ranking:
        ranking.write(EDITED_FUNCTION)
    return runs | {"edited": run()}


@pytest.mark.parametrize("name", [*EDITS, "features"])
def test_compiled_code_follows(answers, name):
    assert [run[name] for run in answers.values()] == [False, False, True]


def test_the_unchanged_package_is_loaded(answers):
    assert [run["hits"] for run in answers.values()] == [0, 2, 0]
    assert [run["misses"] for run in answers.values()] == [2, 0, 2]
