"""The identity of functions that are handed to a run."""

import linecache
import runpy
import subprocess
import sys
import textwrap
from functools import partial
from pathlib import Path
from types import ModuleType

import numpy as np
import pandas as pd
import pytest

from tests.agent.runs import ROOT
from unload import PEQNetwork, stack_load
from unload.agent.identity import identity
from unload.load.boxes import Load

# A module of this package.
SIBLING = ModuleType("tests.sibling")
CODE = """
    import functools
    LIMIT = 3

    @functools.cache
    def table():
        return 7

    class Base:
        def size(self):
            return 5

    class Kind(Base):
        @staticmethod
        def inside():
            return table()

    def helper(run):
        return run * LIMIT or TABLE["change"](run)

    def change(run, share=LIMIT):
        "What it does."
        # why
        return helper(run) + Kind().size() + len(TABLE["a"])

    TABLE = {"a": [1, 2], "change": change}
"""


@pytest.mark.parametrize(
    ("old", "new", "same"),
    [
        ("# why", "# another comment, and a line\n\n", True),
        ('"What it does."', '"Something else."', True),
        ("helper(run) +", "helper(run) -", False),
        ("run * LIMIT", "run / LIMIT", False),  # in what it calls, which calls it again
        ("return 5", "return 6", False),  # in the base of a class that it uses
        ("return 7", "return 8", False),  # in what that class's static method calls, and is cached
        ("LIMIT = 3", "LIMIT = 4", False),  # a number of its own package
        ("[1, 2]", "[1, 5]", False),
    ],
)
def test_other_code_is_another_function_and_another_comment_is_not(tmp_path, old, new, same):
    """Of a caller's own module, in another file each time: Python keeps the lines of one."""
    assert CODE.count(old) == 1
    found = []
    for number, source in enumerate([CODE, CODE.replace(old, new), CODE]):
        path = tmp_path / f"{number}.py"
        path.write_text(textwrap.dedent(source))
        found.append(identity(runpy.run_path(path, run_name="own.module")["change"]))
    one, other, again = found
    assert one == again == "own.module.change 2bf649a0f09f9449", "kept runs are known by it"
    assert (one == other) == same


def enclosing(walls: int):
    return lambda rng: stack_load(rng, walls=walls)


def with_default(walls: int):
    return lambda rng, number=walls: stack_load(rng, walls=number)


def with_module(walls: int):
    SIBLING.walls = walls
    return lambda rng: stack_load(rng, walls=SIBLING.walls)


class Maker:
    """A stack that has settings."""

    def __init__(self, walls: int) -> None:
        self.walls = walls

    def __call__(self, rng):
        return stack_load(rng, walls=self.walls)

    def stack(self, rng):
        return stack_load(rng, walls=self.walls)


@pytest.mark.parametrize(
    "made",
    [
        enclosing,
        with_default,
        with_module,
        lambda walls: [lambda rng: 10, lambda rng: 11][walls - 10],
        Maker,
        lambda walls: Maker(walls).stack,
        lambda walls: partial(stack_load, walls=walls),
        lambda walls: partial(partial(stack_load, walls=walls), rows=3),
        lambda walls: partial(print, [{"load": Load([[walls / 10, 1, 0.5]], np.ones((1, 3)))}]),
        lambda walls: partial(print, np.arange(walls)),
        lambda walls: partial(print, np.array(["a", walls], object)),
        lambda walls: partial(print, Path(f"{walls}.csv")),
        lambda walls: partial(print, {"a", walls}),
        lambda walls: partial(print, pd.DataFrame({"a": [walls]})),
    ],
)
def test_what_a_function_holds_tells_it_from_another(made):
    assert identity(made(10)) == identity(made(10)) != identity(made(11))


def test_identities_hold_no_addresses_and_no_place_of_a_module():
    """Texts in arrays are objects, a set has no order, and an object may hold its own methods."""
    one, other = ([text, "".join(reversed(text))] for text in ("ab" * 9, "".join(["ab"] * 9)))
    assert identity(np.array(one, object)) == identity(np.array(other, object))
    assert identity({"b", "a"}) == ["a", "b"]
    maker = Maker(3)
    maker.own = maker.stack
    assert identity(maker.stack)["of"][1]["walls"] == 3
    SIBLING.walls = Path("/one")
    before = identity(lambda rng: SIBLING.walls)
    SIBLING.walls = Path("/other")
    assert identity(lambda rng: SIBLING.walls) == before


def test_names_can_be_read():
    assert identity(partial(stack_load, walls=3)) == {
        "function": "unload.load.substacks.stack_load", "arguments": [], "keywords": {"walls": 3},
    }  # fmt: skip
    assert identity(PEQNetwork) == "unload.network.peq.PEQNetwork"
    assert identity([np.float32(0.5), None, range(2)]) == [0.5, None, [0, 1]]


def test_a_function_without_source_is_the_same_in_each_process():
    """Typed at a prompt, say: its bytecode holds no addresses."""
    code = "def f(run): return [lambda: 3 for each in run]"
    elsewhere = f"from unload.agent.identity import identity\nexec({code!r})\nprint(identity(f))"
    command = [sys.executable, "-c", elsewhere]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    found = []
    for source in (code, code.replace("3", "4")):
        exec(source, names := {"__name__": "__main__"})
        found.append(identity(names["f"]))
    assert done.stdout.startswith("__main__.f ")
    assert found[0] == done.stdout.strip() != found[1]


@pytest.mark.parametrize("text", ["", "def other(run): return 3\n", "f = 3\n"])
def test_a_function_is_not_taken_for_a_text_of_the_same_name(text, monkeypatch):
    """From Python 3.13 on, the text of ``python -c`` can be read, under the name of ``exec``'s."""
    found = []
    for source in ("def f(run): return 1", "def f(run): return 2"):
        exec(compile(source, "<shared>", "exec"), names := {"__name__": "__main__"})
        monkeypatch.setitem(linecache.cache, "<shared>", (1, None, [text or "\n"], "<shared>"))
        found.append(identity(names["f"]))
    assert found[0] != found[1]
