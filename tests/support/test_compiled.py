"""Compiled code on disk: used again as long as nothing changes that it was built from."""

import importlib
import linecache
import sys
import warnings
from pathlib import Path

import numba
import pytest
from numba.core.caching import IndexDataCacheFile

import unload
from unload.support.compiled import fingerprint

PACKAGE = Path(unload.__file__).parent

# A package whose last module uses what the others define.
SOURCES = {
    "__init__": "",
    "constants": """
LIMIT = 1
""",
    "called": """
from typing import NamedTuple

from made.constants import LIMIT
from unload.support.compiled import compiled


class Point(NamedTuple):
    x: int
    y: int


@compiled
def step(x):
    return x + LIMIT
""",
    "function": """
from made import called
from made.called import Point
from unload.support.compiled import compiled


@compiled
def function(x):
    return called.step(x) + Point(x, 0).x


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
        (tmp_path / "made").mkdir(exist_ok=True)
        fingerprint.cache_clear()
        for name, source in SOURCES.items():
            for old, new in edits:
                source = source.replace(old, new)
            (tmp_path / f"made/{name}.py").write_text(source)
        forget()
        return importlib.import_module("made.function")

    yield load
    forget()


def forget() -> None:
    """Let the package be imported anew, and its files be read anew."""
    for name in SOURCES:
        sys.modules.pop(f"made.{name}".removesuffix(".__init__"), None)
    importlib.invalidate_caches()
    linecache.clearcache()
    fingerprint.cache_clear()


@pytest.mark.parametrize(
    "edit",
    [("LIMIT = 1", "LIMIT = 2"), ("x + LIMIT", "x - LIMIT"), ("Point(x, 0)", "Point(x, 1)")],
    ids=lambda edit: edit[1],
)
def test_the_fingerprint_changes_with(load, edit):
    load(edit)
    changed = fingerprint("made.function")
    load()
    assert fingerprint("made.function") != changed


def test_what_a_module_does_not_import_is_not_in_its_fingerprint(load):
    load(("def function", "def another"))
    changed = fingerprint("made.called")
    load()
    assert fingerprint("made.called") == changed


@pytest.mark.parametrize("version", range(4))
def test_the_fingerprint_changes_with_the_versions(load, version, monkeypatch):
    load()
    before = fingerprint("made.function")
    versions = [*unload.support.compiled.VERSIONS]
    versions[version] += "1"
    monkeypatch.setattr(unload.support.compiled, "VERSIONS", tuple(versions))
    fingerprint.cache_clear()
    assert fingerprint("made.function") != before


def test_unchanged_code_is_loaded(load):
    assert load().function(5) == 11
    function = load().function
    assert function(5) == 11
    assert sum(function.stats.cache_hits.values()) == 1 and not function.stats.cache_misses
    assert load(("LIMIT = 1", "LIMIT = 2")).function(5) == 12
    assert load().function(5) == 11


def test_a_file_that_changes_after_its_import_is_not_taken_for_what_is_compiled(load, tmp_path):
    module = load()
    path = tmp_path / "made/constants.py"
    path.write_text(path.read_text().replace("LIMIT = 1", "LIMIT = 2"))
    assert module.function(5) == 11
    assert load(("LIMIT = 1", "LIMIT = 2")).function(5) == 12


def test_fields_of_a_named_tuple_that_change_places(load):
    """numba's own cache, too, would return the other field."""
    module = load()
    assert module.of_point(module.Point(x=1, y=2)) == 1
    module = load(("    x: int\n    y: int", "    y: int\n    x: int"))
    assert module.of_point(module.Point(x=1, y=2)) == 1


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
    (tmp_path / "made").mkdir()
    (tmp_path / "made/__pycache__").write_text("not a folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "user"))
    assert load().function(5) == 11
    function = load().function
    assert function(5) == 11 and function.stats.cache_path.startswith(str(tmp_path / "user"))
    assert sum(function.stats.cache_hits.values()) == 1


def test_the_first_compilation_of_a_process_is_logged(load, tmp_path, monkeypatch, caplog):
    monkeypatch.setattr(unload.support.compiled._Cache, "logged", False)
    load().function(5)
    (record,) = caplog.records
    assert "compiling made.function.function and others" in record.message
    assert str(tmp_path / "made/__pycache__") in record.message
    caplog.clear()
    monkeypatch.setattr(unload.support.compiled._Cache, "logged", False)
    load().function(5)
    assert not caplog.records, "it is loaded"


def test_without_a_folder_code_is_kept_in_memory_with_one_warning(load, tmp_path, monkeypatch):
    (tmp_path / "made").mkdir()
    (tmp_path / "made/__pycache__").write_text("not a folder")
    (tmp_path / "user").write_text("not a folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "user"))
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("default")
        module = load()
    assert module.function(5) == 11
    assert ["set NUMBA_CACHE_DIR" in str(each.message) for each in warned] == [True]


def test_every_compiled_function_is_compiled_so():
    here = PACKAGE / "support" / "compiled.py"
    for path in PACKAGE.rglob("*.py"):
        assert path == here or "njit" not in path.read_text(), f"{path} should use compiled"
