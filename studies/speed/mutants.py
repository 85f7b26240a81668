"""Mutation testing: small changes to the code, and which of them no test notices.

    make mutants                                                        a sample of every room
    python -m studies.speed.mutants --rooms unload/env --sample 30      of one room

Each mutant is one change to a module in a copy of the tree, where the tests of its room run, those
of the module first. Raised errors, annotations, decorators and texts are not changed. A module of
compiled functions runs as plain Python, except in ``unload/fast``, whose kernel has instructions
that Python does not have. ``build/mutants.csv`` says which test has killed each mutant, if any.
Many survivors are equivalent: no result depends on the change beyond rounding.
"""

import argparse
import ast
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from copy import deepcopy
from pathlib import Path
from queue import SimpleQueue

import numpy as np
import pandas as pd

from studies.paths import ROOT

PATH = ROOT / "build" / "mutants.csv"
COLUMNS = ["room", "module", "line", "mutation"]  # and "killed_by"
WORKERS = 2  # processes side by side
MODULES = sorted((ROOT / "unload").rglob("*.py")) + sorted((ROOT / "studies").rglob("*.py"))
# The tests that have to notice the mutants of a room, which is the modules of one folder.
ROOMS = dict.fromkeys(path.parent.relative_to(ROOT).as_posix() for path in MODULES)
ROOMS = {room: f"tests/{room.removeprefix('unload/')}" for room in ROOMS} | {
    "unload": "tests/test_main.py tests/load tests/env tests/agent/test_[op]*.py",
    "unload/fast": "tests/fast tests/env/test_[ev]*.py",
    "studies": "tests/studies/test_*.py tests/studies/policies/test_policies.py",
    "studies/speed": "tests/studies/test_speed.py",
}
# What a study draws and tells is compared with what is published, and so are its settings.
PUBLISHED = (
    " tests/studies/test_main.py tests/studies/test_results.py tests/studies/test_published.py"
)
ROOMS |= {room: tests + PUBLISHED for room, tests in ROOMS.items() if room.startswith("studies/")}
# What overflows in plain Python, where warnings are errors, does so in silence when compiled.
OPTIONS = ["-q", "-x", "-m", "not slow", "-W", "ignore:overflow encountered"]
PAIRS = {
    ast.Lt: ast.LtE, ast.Gt: ast.GtE, ast.Eq: ast.NotEq, ast.Is: ast.IsNot, ast.In: ast.NotIn,
    ast.Add: ast.Sub, ast.Mult: ast.Div, ast.And: ast.Or, ast.BitAnd: ast.BitOr,
    ast.Mod: ast.Mult, ast.FloorDiv: ast.Mult, ast.Pow: ast.Mult,
}  # fmt: skip
SWAPS = {after: before for before, after in PAIRS.items()} | PAIRS


def changed(node: ast.AST) -> ast.AST | None:
    """A small change of an expression or statement; None where there is none."""
    new = deepcopy(node)
    if isinstance(node, ast.Compare) and type(node.ops[0]) in SWAPS:
        new.ops[0] = SWAPS[type(node.ops[0])]()
    elif isinstance(node, (ast.BinOp, ast.BoolOp, ast.AugAssign)) and type(node.op) in SWAPS:
        new.op = SWAPS[type(node.op)]()
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        new = node.operand
    elif isinstance(node, ast.Constant) and isinstance(node.value, (bool, int, float)):
        new.value = not node.value if isinstance(node.value, bool) else node.value * 2 + 1
    elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
        new = ast.Pass()
    else:
        return None
    return new


def nodes(tree: ast.AST) -> Iterator[ast.AST]:
    """What may be changed: all but errors, annotations, decorators, imports and parts of texts."""
    for field, value in ast.iter_fields(tree):
        if field not in ("annotation", "returns", "decorator_list"):
            for child in value if isinstance(value, list) else [value]:
                if isinstance(child, ast.AST) and not isinstance(child, (ast.Raise, ast.JoinedStr)):
                    yield child
                    yield from nodes(child)


def mutants(path: Path) -> Iterator[tuple[Path, int, str, bytes]]:
    """Each mutant of a module: its path, the line, what is changed there, and all code after it."""
    source = path.read_bytes()  # in bytes, as columns are counted
    starts = np.cumsum([0, *map(len, source.splitlines(keepends=True))])
    for node in nodes(ast.parse(source)):
        if (new := changed(node)) is not None:
            start = starts[node.lineno - 1] + node.col_offset
            end = starts[node.end_lineno - 1] + node.end_col_offset
            text = ast.unparse(new) if isinstance(new, ast.stmt) else f"({ast.unparse(new)})"
            code = source[:start] + text.encode() + source[end:]
            yield path, node.lineno, f"{ast.unparse(node)} -> {ast.unparse(new)}", code


def plain(room: str, source: bytes) -> bool:
    """Whether a module runs without compiling, as the module's docstring says."""
    return room != "unload/fast" and re.search(rb"^@compiled", source, re.MULTILINE) is not None


def killed_by(trees: SimpleQueue, room: str, path: Path, code: bytes | None, limit: float) -> str:
    """What fails first in a room's tests if a module has other code, or as it is if None."""
    tree = trees.get()
    copy = tree / path.relative_to(ROOT)
    before = copy.read_bytes()
    copy.write_bytes(code or before)
    tests = [each for pattern in ROOMS[room].split() for each in sorted(tree.glob(pattern))]
    own = [each for folder in tests for each in folder.glob(f"test_{path.stem}.py")]
    command = ["timeout", "-s", "KILL", f"{limit:.0f}", sys.executable, "-m", "pytest", *OPTIONS]
    # Bytecode is known by the second and the size of its source, which a mutant may share.
    env = os.environ | {"PYTHONDONTWRITEBYTECODE": "1", "OMP_NUM_THREADS": "1"}
    env["NUMBA_DISABLE_JIT"] = str(int(plain(room, before)))
    ended = subprocess.run([*command, *own, *tests], cwd=tree, env=env, capture_output=True)
    copy.write_bytes(before)
    trees.put(tree)
    if ended.returncode in (137, -9):  # killed by ``timeout``
        return "time limit"
    failed = re.findall(r"^(?:FAILED|ERROR) (\S+)", ended.stdout.decode(), re.MULTILINE)
    return (failed or ["no test could start"])[0] if ended.returncode else ""


def measure(room: str, sample: int, seed: int, trees: SimpleQueue) -> pd.DataFrame:
    """A sample of the mutants of a room: ``COLUMNS``, and ``killed_by``, empty if none is."""
    paths, start = [path for path in MODULES if path.parent == ROOT / room], time.monotonic()
    found = [mutant for path in paths for mutant in mutants(path)]
    for path in {plain(room, path.read_bytes()): path for path in paths}.values():
        if failed := killed_by(trees, room, path, None, limit=3600):
            raise RuntimeError(f"the tests of {room} fail without any change: {failed}")
    limit = 3 * (time.monotonic() - start) + 20  # two at once, and compiled again
    rng = np.random.default_rng([seed, *room.encode()])
    numbers = rng.choice(len(found), min(sample, len(found)), replace=False)
    chosen = [found[number] for number in sorted(numbers)]
    rows = [(room, path.stem, line, mutation) for path, line, mutation, _ in chosen]
    with ThreadPoolExecutor(WORKERS) as pool:
        killers = pool.map(lambda each: killed_by(trees, room, each[0], each[3], limit), chosen)
        return pd.DataFrame(rows, columns=COLUMNS).assign(killed_by=list(killers))


def main() -> None:
    parser = argparse.ArgumentParser(description="Mutation testing.")
    parser.add_argument("--rooms", nargs="+", choices=ROOMS, default=tuple(ROOMS), metavar="ROOM")
    parser.add_argument("--sample", type=int, default=20, help="mutants of a room")
    parser.add_argument("--seed", type=int, default=0, help="of the sample")
    options, trees, tables = parser.parse_args(), SimpleQueue(), []
    PATH.parent.mkdir(exist_ok=True)
    left_out = shutil.ignore_patterns(".git", ".venv", "*cache*", "build", "runs")
    with tempfile.TemporaryDirectory() as folder:
        for number in range(WORKERS):
            trees.put(Path(shutil.copytree(ROOT, Path(folder) / f"{number}", ignore=left_out)))
        for room in options.rooms:
            table = measure(room, options.sample, options.seed, trees)
            print(f"{room}: {(table['killed_by'] == '').sum()} of {len(table)} survive", flush=True)
            tables.append(table)
            pd.concat(tables).to_csv(PATH, index=False, lineterminator="\n")


if __name__ == "__main__":
    main()
