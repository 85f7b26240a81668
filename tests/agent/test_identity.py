"""The identity of functions that are handed to a run."""

import enum
import importlib
import operator
import os
import sys
import textwrap
import threading
import time
from collections import defaultdict
from fractions import Fraction
from functools import cache, partial, update_wrapper
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
import torch

from tests.agent.runs import CONTAINER, ROOT
from unload import PEQNetwork, TrainConfig, stack_load, train
from unload.agent.identity import UNKNOWN, identity
from unload.load.boxes import Load

# A module of this package.
SIBLING = ModuleType("tests.sibling")
OPTIONS = SimpleNamespace(walls=0)
FILES = {
    "own_change": """
        from own_helper import draw

        PAIR = [lambda rng: 10, lambda rng: 11]

        def change(run):
            import own_late
            return run + draw() + own_late.more
    """,
    "own_helper": """
        from own_far import FAR

        def draw():
            return FAR
    """,
    "own_far": "FAR = 7",
    "own_late": "more = 1",
}


@pytest.fixture
def imported(tmp_path, monkeypatch):
    """``imported(old, new)``: the change of ``FILES``, imported after one text was replaced."""
    monkeypatch.syspath_prepend(tmp_path)
    clock = iter(range(1, 100))

    def write(old: str = "", new: str = "") -> None:
        for name, text in FILES.items():
            path = tmp_path / f"{name}.py"
            path.write_text(textwrap.dedent(text).replace(old, new), encoding="utf-8")
            os.utime(path, ns=(0, next(clock) * 10**12))

    def load(old: str = "", new: str = ""):
        write(old, new)
        for name in FILES:
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        return importlib.import_module("own_change").change

    load.write = write
    yield load
    for name in FILES:
        sys.modules.pop(name, None)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("run + draw", "run - draw"),  # anywhere in its file
        ("return FAR", "return 2 * FAR"),  # in another top-level module
        ("FAR = 7", "FAR = 8"),  # in one that this imports
        ("more = 1", "more = 2"),  # in one that is imported when it runs
    ],
)
def test_other_code_is_another_function(imported, old, new):
    one, other, again = (identity(imported(*each)) for each in ((), (old, new), ()))
    assert one == again != other and one.startswith("own_change.change ")


def test_functions_of_one_name_in_one_file_are_told_apart(imported):
    """They once were the same."""
    imported()
    one, other = sys.modules["own_change"].PAIR
    assert identity(one) != identity(other)


@pytest.mark.parametrize(("old", "new"), [("run + draw", "run - draw"), ("return FAR", "return 8")])
def test_a_file_that_was_changed_after_its_import_is_refused(imported, tmp_path, old, new):
    """Results of the old code were once filed under the new: its own file's, and a helper's."""
    change = imported()
    before = identity(change)
    imported.write(old, new)
    with pytest.raises(ValueError, match=r"own_\w+.py was changed after \w+ was imported from it"):
        train(TrainConfig(**CONTAINER), tmp_path / "run", progress=False, change=change)
    assert not (tmp_path / "run" / "config.json").exists()
    imported.write()
    assert identity(change) == before


def enclosing(walls: int):
    return lambda rng: stack_load(rng, walls=walls)


def with_later_default(walls: int):
    def stack(rng, number=3):
        return stack_load(rng, walls=number)

    stack.__defaults__ = (walls,)
    return stack


def with_attribute(walls: int):
    def stack(rng):
        return stack_load(rng, walls=stack.walls)

    stack.walls = walls
    return stack


@cache
def cached() -> int:
    return OPTIONS.walls


def with_names_of(use):
    """Makes a function that uses names of modules, which hold a number."""

    def make(walls: int):
        SIBLING.walls = OPTIONS.walls = walls
        return use

    return make


class Maker:
    """A stack that has settings."""

    def __init__(self, walls: int) -> None:
        self.walls = walls

    def __call__(self, rng):
        return stack_load(rng, walls=self.walls)

    def stack(self, rng):
        return stack_load(rng, walls=self.walls)


class Size(enum.Enum):
    SMALL = 10
    LARGE = 11


VALUES = [
    lambda walls: Load([[walls / 10, 1, 0.5]], np.ones((1, 3))),
    lambda walls: np.array(["a", walls], object),
    lambda walls: Path(f"{walls}.csv"),
    lambda walls: {"a", walls},
    lambda walls: torch.full((2,), float(walls)),
    bytes,
    Size,
    lambda walls: Fraction(walls, 3),
    operator.itemgetter,
    np.random.default_rng,
    lambda walls: SimpleNamespace(walls=walls),
    lambda walls: defaultdict(lambda: walls),
    lambda walls: {[1, "1"][walls - 10]: 2},
    lambda walls: enum.IntEnum(f"Kind{walls}", "A").A,
]


@pytest.mark.parametrize(
    "made",
    [
        enclosing,
        with_later_default,
        with_names_of(lambda rng: stack_load(rng, walls=SIBLING.walls)),
        with_names_of(lambda rng: stack_load(rng, walls=OPTIONS.walls)),
        with_names_of(lambda rng: stack_load(rng, walls=cached())),
        Maker,
        lambda walls: Maker(walls).stack,
        lambda walls: update_wrapper(Maker(walls), stack_load),
        lambda walls: type("Own", (partial,), {"walls": walls})(stack_load),
        with_attribute,
        lambda walls: partial(partial(stack_load, walls=walls), rows=3),
        *(lambda walls, make=make: partial(print, [{"a": make(walls)}]) for make in VALUES),
    ],
)
def test_what_a_function_holds_tells_it_from_another(made):
    assert identity(made(10)) == identity(made(10)) != identity(made(11))
    assert UNKNOWN not in str(identity(made(10)))


def deep() -> list:
    """A list that holds itself."""
    within: list = []
    within.append(within)
    return within


@pytest.mark.parametrize("value", [threading.Lock(), deep(), (each for each in ())])
def test_what_cannot_be_told_apart_is_trained_with_and_never_taken_for_the_same(tmp_path, value):
    def change(run):
        run.held = value

    config = TrainConfig(**CONTAINER)
    for each in (change, partial(print, value)):
        assert UNKNOWN in str(identity(each)) and identity(each) != identity(each)
    assert len(train(config, tmp_path, progress=False, change=change).curve) == 10
    with pytest.raises(ValueError, match=f"change .*{UNKNOWN}"):
        train(config, tmp_path, progress=False, change=change)


def test_identities_hold_no_addresses_and_no_place_of_a_module():
    """Texts in arrays are objects, a set has no order, and an object may hold its own methods."""
    one, other = ([text, "".join(reversed(text))] for text in ("ab" * 9, "".join(["ab"] * 9)))
    assert identity(np.array(one, object)) == identity(np.array(other, object))
    assert identity({"b", "a"}) == identity({"a", "b"})
    SIBLING.walls = Path("/one")
    before = identity(lambda rng: SIBLING.walls)
    SIBLING.walls = Path("/other")
    assert identity(lambda rng: SIBLING.walls) == before


def test_names_can_be_read():
    assert identity(partial(stack_load, walls=3)) == {
        "function": "unload.load.substacks.stack_load", "arguments": [], "keywords": {"walls": 3},
    }  # fmt: skip
    assert identity(PEQNetwork) == "unload.network.peq.PEQNetwork"
    assert identity([{"a": 0.5}, None, (1, 2)]) == [{"a": 0.5}, None, [1, 2]]
    assert identity({1: 2, "1": 3}) != identity({1: 4, "1": 3}), "JSON has one of each key"


def test_a_library_is_not_read():
    """That of a module of PyTorch once took minutes."""
    start = time.process_time()
    identity(partial(stack_load, network=torch.nn.Linear(3, 4), other=PEQNetwork()))
    assert time.process_time() - start < 0.1


TYPED = {
    "what a try covers": (
        "def f(run):\n try: run.a(); run.b()\n except OSError: pass",
        "def f(run):\n try: run.a()\n except OSError: pass\n else: run.b()",
    ),
    "names of arguments": (
        "def g(p, q): return p - q\ndef f(run): return g(p=1, q=2)",
        "def g(q, p): return q - p\ndef f(run): return g(p=1, q=2)",
    ),
    "a list of arguments": ("def f(run): return run", "def f(*run): return run"),
    "a path": tuple(
        f"import pathlib\nname = pathlib.Path('{name}')\ndef f(run): return name" for name in "ab"
    ),
    "what sets a property": tuple(
        "class K:\n @property\n def a(self): return self.b\n @a.setter\n"
        f" def a(self, value): self.b = value * {number}\ndef f(run): K().a = 1"
        for number in (1, 2)
    ),
    "how an object is called": tuple(
        f"class K:\n def __call__(self): return {number}\ndef f(run): return K()()"
        for number in (1, 2)
    ),
    "a class of classes": tuple(
        f"class M(type):\n def a(self): return {number}\nclass K(metaclass=M): pass\n"
        "def f(run): return K.a()"
        for number in (1, 2)
    ),
}


def typed(source: str):
    """The function ``f`` of what is typed in a notebook, say."""
    exec(source, names := {"__name__": "__main__"})
    return names["f"]


@pytest.mark.parametrize(("one", "other"), TYPED.values(), ids=TYPED)
def test_other_code_that_was_typed_is_another_function(one, other):
    assert identity(typed(one)) == identity(typed(one)) != identity(typed(other))


@pytest.mark.parametrize("line", ["import own_late", "from own_late import more"])
def test_a_module_that_typed_code_imports_when_it_runs_counts(imported, line):
    names = [(), ("more = 1", "more = 2"), ()]
    one, other, again = (
        imported(*each) and identity(typed(f"def f(run):\n {line}")) for each in names
    )
    assert one == again != other


@pytest.mark.parametrize("seed", ["1", "2"])
def test_a_function_without_source_is_the_same_in_each_process(run_python, seed):
    """Typed at a prompt, say: its bytecode holds no addresses, and its sets have an order."""
    code = "def f(run): return [lambda: 3 for each in run if each in {'a', 'b', 'c', 'd'}]"
    elsewhere = f"from unload.agent.identity import identity\nexec({code!r})\nprint(identity(f))"
    printed, _ = run_python(elsewhere, ROOT, PYTHONHASHSEED=seed)
    one, other = (identity(typed(source)) for source in (code, code.replace("3", "4")))
    assert printed == f"{one}\n" and one.startswith("__main__.f ") and one != other
