"""Compiled code on disk: used again as long as nothing changes that it was built from."""

import re
import shutil
import sys
from functools import partial
from pathlib import Path

import numba
import numpy as np

import unload
from unload.support import compiled
from unload.support.compiled import Compiled

PACKAGE = Path(unload.__file__).parent
# A module whose compiled function reads a constant of another one.
MODULE = """
from unload import task
from unload.support.compiled import compiled

@compiled
def least(margin):
    return task.LIFT_THRESHOLD + margin

print(round(least(0.1), 6), sum(least.dispatcher.stats.cache_hits.values()))
"""


def test_code_is_compiled_once_for_each_value_of_a_constant(tmp_path, run_python):
    """In a copy of the package, in whose ``load/`` stands a module ``made``."""
    package = tmp_path / "unload"
    ignored = shutil.ignore_patterns("__pycache__", "data", "agent", "env", "network")
    shutil.copytree(PACKAGE, package, ignore=ignored)
    (package / "load/made.py").write_text(MODULE, encoding="utf-8")
    given = {"PYTHONPATH": "", "NUMBA_CACHE_DIR": ""}
    run = partial(run_python, "import unload.load.made", tmp_path, **given)
    printed, said = run()
    assert printed == "0.3 0\n"
    assert said.count("compiling for this processor") == said.count("\n") == 1
    assert str(package / "__pycache__/compiled-") in said
    constants = (package / "task.py").read_text(encoding="utf-8")
    other = constants.replace("LIFT_THRESHOLD = 0.2", "LIFT_THRESHOLD = 0.5")
    (package / "task.py").write_text(other, encoding="utf-8")
    printed, said = run()
    assert printed == "0.6 0\n" and "compiling" in said
    (package / "task.py").write_text(constants, encoding="utf-8")
    assert run() == ("0.3 1\n", "")
    own = given | {"NUMBA_CACHE_DIR": str(tmp_path / "own")}
    _, said = run_python("import unload.load.made", tmp_path, **own)
    assert str(tmp_path / "own/compiled-") in said


def tripled(number):
    return number * 3


def test_a_lazy_function_is_compiled_as_soon_as_another_one_is(monkeypatch):
    """Numba's settings stay the user's."""
    function, before = Compiled(tripled, True, {}), numba.config.CACHE_DIR
    monkeypatch.setattr(Compiled, "any_compiled", False)
    assert function(2) == 6 and "dispatcher" not in vars(function)
    other = Compiled(tripled, False, {})
    assert other(2) == 6 and Compiled.any_compiled
    assert function(2) == 6 and "dispatcher" in vars(function)
    assert numba.config.CACHE_DIR == before


def test_each_version_of_python_and_its_libraries_has_code_of_its_own(monkeypatch):
    found = {compiled._digest(PACKAGE)}
    for owner, name in ((sys, "version"), (np, "__version__"), (numba, "__version__")):
        with monkeypatch.context() as other:
            other.setattr(owner, name, "another")
            found.add(compiled._digest(PACKAGE))
    assert len(found) == 4


def test_all_that_compiled_functions_read_is_among_the_sources():
    """But for types that none of them reads."""
    sources = {path for pattern in compiled._SOURCES for path in PACKAGE.glob(pattern)}
    outside = set()
    for path in PACKAGE.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        assert "njit" not in text or path.name == "compiled.py", f"{path} should use compiled"
        if "import compiled" in text:
            assert path in sources
            origins = re.findall(r"^from unload\.(\w+)\.(\w+) import", text, re.MULTILINE)
            for room, module in origins:
                if PACKAGE / room / f"{module}.py" not in sources:
                    outside.add(f"{room}.{module}")
    assert outside == {"network.peq"}
