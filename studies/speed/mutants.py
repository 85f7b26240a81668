"""Mutation testing: small changes to the code, and how many of them the tests notice.

    make mutants                                       a sample of each module's mutants
    python studies/speed/mutants.py agent/dqn --sample 0  all mutants of one module
    python studies/speed/mutants.py --sample 12 --seed 33 --keep    for data/benchmarks

Cosmic Ray makes the mutants. mutmut 3 leaves decorated functions alone, and so would miss all
compiled ones. Each mutant's module is changed in a copy of the tree, where a forked process
then runs the tests that belong to it; to fork saves importing PyTorch a thousand times. Modules
with compiled functions run as plain Python, so that nothing is compiled; those in ``agent/fast``,
whose kernel has instructions that Python does not have, are compiled anew for each mutant, and so
that they refuse places outside of their arrays.

Left out are changes without an effect on behaviour: in annotations, in errors that are raised
(the condition for it counts) and of ``is`` for ``==``. So are decorators, most of which make a
function fast only, and operators that numbers of the other kind do not have, such as ``<<`` in
place of ``*``, because each call of such a mutant fails, which would only raise the score.

The scores are printed at the end, and all outcomes kept in ``build/mutants.csv``. Most survivors
are equivalent to the code as it is: no result depends on the change beyond rounding. Why one
survives is written by hand into ``survivors.csv`` in ``data/benchmarks``, which keeps it.
"""

import argparse
import ast
import contextlib
import os
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from importlib.util import cache_from_source
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = "1"

# Imported before any process is forked; the package itself only afterwards, from the copy.
import gymnasium  # noqa: F401
import hypothesis  # noqa: F401
import numba
import numpy as np
import pandas as pd
import pybullet  # noqa: F401
import pytest
import scipy.stats
import stable_baselines3  # noqa: F401
import torch
from cosmic_ray.commands.init import _all_work_items
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator

ROOT = Path(__file__).resolve().parent.parent
KEPT = ROOT / "data" / "benchmarks"
SAMPLE, SEED = 40, 0  # mutants per module, and of their choice
COPIED = ("unload", "tests", "data", "pyproject.toml", "README.md", ".gitignore")
# Tests of the array environment that are quick as plain Python.
FEW_PICKS = " ".join(
    f"env/test_vector.py::test_{name}"
    for name in (
        "what_can_be_seen_and_lifted_is_that_of_the_single_environments",
        "a_pick_that_is_interrupted_needs_a_reset",
        "episodes_that_end_at_once", "unknown_lifts_are_simulated_once_and_remembered",
        "fewer_boxes_may_have_more_contacts",
    )
)  # fmt: skip
# That lifts are those of the table that ships.
SHIPPED = "physics/test_table.py::test_shipped_table_fits_this_physics"
# The modules, and the tests in tests/ that have to notice their mutants.
MODULES = {
    "__init__": "test_installed.py::test_an_import_takes_few_modules agent/test_policies.py",
    "task": "load/test_substacks.py env/test_observation.py reproduce/paper/test_numbers.py",
    "load/boxes": "load/test_boxes.py",
    "load/packing_list": "load/test_packing_list.py",
    "load/substacks": "load/test_substacks.py",
    "load/view": "load/test_view.py",
    "physics/base": "physics/test_base.py",
    "physics/bullet": f"physics/test_bullet.py {SHIPPED}",
    "physics/full": "physics/test_full.py",
    "physics/local": f"physics/test_local.py physics/test_base.py {SHIPPED}",
    "physics/situation": "physics/test_situation.py env/fast/test_containers.py",
    "physics/table": "physics/test_table.py",
    "env/base": "env/test_base.py env/test_container.py env/test_vector.py",
    "env/container": "env/test_container.py env/test_base.py env/test_vector.py",
    "env/equalization": "env/test_equalization.py",
    "env/highest_item": "env/test_highest_item.py env/test_base.py env/test_vector.py",
    "env/observation": "env/test_observation.py env/test_base.py env/test_container.py",
    "env/sb3": "env/test_sb3.py",
    "env/vector": "env/test_vector.py env/test_base.py",
    "env/fast/containers": f"env/fast/test_containers.py {FEW_PICKS}",
    "env/fast/ranking": "env/fast/test_ranking.py",
    "network/peq": "network/test_peq.py network/test_variants.py",
    "network/variants": "network/test_variants.py",
    "network/weights": "network/test_weights.py agent/test_greedy.py",
    "agent/checkpoint": "agent/test_checkpoint.py agent/test_training.py",
    "agent/config": "agent/test_config.py",
    "agent/dqn": "agent/test_dqn.py",
    "agent/evaluation": "agent/test_evaluation.py",
    "agent/greedy": "agent/test_greedy.py",
    "agent/learner": "agent/test_learner.py agent/test_dqn.py agent/test_greedy.py",
    "agent/order": "agent/test_order.py",
    "agent/policies": "agent/test_policies.py",
    "agent/replay": "agent/test_replay.py",
    "agent/rollout": "agent/test_rollout.py agent/test_checkpoint.py agent/test_training.py",
    "agent/sweep": "agent/test_sweep.py",
    "agent/training": "agent/test_training.py agent/test_checkpoint.py",
    "agent/fast/fused": "agent/fast/test_fused.py",
    "agent/fast/kernel": "agent/fast/test_fused.py",
    "agent/fast/learner": "agent/fast/test_learner.py agent/test_learner.py agent/test_dqn.py",
    "support/checks": "support/test_checks.py",
    "support/compiled": "support/test_compiled.py",
    "support/files": "support/test_files.py",
    "support/provenance": "support/test_provenance.py",
}
# Tests that take long, or start processes of their own.
SLOW = "[full or program_ends or processes_that or two_processes or 64_containers or agent_learns"
NO_CACHE = shutil.ignore_patterns("__pycache__")  # the first run compiles, as mutants do
WALL_LIMIT = 900  # s, of a run that waits for ever
OTHER_CODE = 99  # exit status of a process that did not import the package from its copy
# Operators that may stand for each other.
GROUPS = (
    {"Add", "Sub", "Mul", "Div", "FloorDiv"},
    {"Mod", "FloorDiv", "Mul"},
    {"Pow", "Mul"},
    {"BitAnd", "BitOr", "BitXor"},
    {"LShift", "RShift"},
)


@dataclass(frozen=True)
class Mutant:
    """One small change to a module.

    Attributes:
        module: its path in unload/, without the suffix.
        line: number of the changed line.
        before, after: this line.
        operator: Cosmic Ray's name of the change.
        code: the whole module after it.
    """

    module: str
    line: int
    before: str
    after: str
    operator: str
    code: str


def mutants(
    path: Path, module: str, sample: int, rng: np.random.Generator
) -> tuple[list[Mutant], int]:
    """A random sample of the mutants of the module at ``path`` by line, and the number of all."""
    source = path.read_text()
    lines, skipped = source.splitlines(), list(_without_behaviour(ast.parse(source)))
    found = []
    for item in _all_work_items([path], {}):
        (mutation,) = item.mutations
        operator, start = mutation.operator_name.removeprefix("core/"), tuple(mutation.start_pos)
        in_signature = lines[start[0] - 1][start[1] :].startswith("*,")  # keyword-only arguments
        skip = in_signature or any(first <= start < end for first, end in skipped)
        if _counts(operator) and not skip:
            found.append((start[0], operator, mutation))
    found.sort(key=lambda each: each[:2])
    count = len(found)
    if sample and count > sample:
        found = [found[i] for i in sorted(rng.choice(count, sample, replace=False))]
    chosen = []
    for _, operator, mutation in found:
        try:
            code = mutate_code(source, get_operator(mutation.operator_name)(), mutation.occurrence)
        except AttributeError:  # Cosmic Ray's, of an exception whose name has a dot
            continue
        pairs = enumerate(zip(lines, code.splitlines()), 1)
        line, (before, after) = next((n, pair) for n, pair in pairs if pair[0] != pair[1])
        chosen.append(Mutant(module, line, before.strip(), after.strip(), operator, code))
    return chosen, count


def _counts(operator: str) -> bool:
    """Whether an operator's mutants are made at all; see the module's docstring."""
    if operator == "RemoveDecorator":
        return False
    kind, _, pair = operator.partition("_")
    before, _, after = pair.partition("_")
    if kind == "ReplaceComparisonOperator":
        return after not in ("Is", "IsNot") or before in ("Is", "IsNot")
    if kind == "ReplaceBinaryOperator":
        return any({before, after} <= group for group in GROUPS)
    return True


def _without_behaviour(tree: ast.AST) -> Iterator[tuple[tuple[int, int], tuple[int, int]]]:
    """Where annotations and raised errors begin and end: (line, column) each."""
    for node in ast.walk(tree):
        parts = [getattr(node, "annotation", None), getattr(node, "returns", None)]
        for part in [*parts, node if isinstance(node, ast.Raise) else None]:
            if isinstance(part, ast.AST):
                yield (part.lineno, part.col_offset), (part.end_lineno, part.end_col_offset)


def run_tests(tree: Path, module: str) -> int:
    """Run a module's tests on a copy of the tree in a process that ends here; pytest's status."""
    os.setsid()
    os.chdir(tree)
    output = os.open(tree / "output.txt", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(output, 1)
    os.dup2(output, 2)
    sys.path.insert(0, str(tree))
    sys.dont_write_bytecode = False
    source = (tree / "unload" / f"{module}.py").read_text()
    has_kernel = module.startswith("agent/fast/")  # and so instructions that Python does not have
    numba.config.DISABLE_JIT = "\n@compiled" in source and not has_kernel
    numba.config.BOUNDSCHECK = has_kernel or None  # as Python does by itself
    torch.set_num_threads(1)
    tests = [f"tests/{name}" for name in MODULES[module].split()]
    options = ["-x", "-p", "no:cacheprovider", "-k", f"not ({SLOW})", "-m", "not slow"]
    # A single number that overflows warns, and one in compiled code does not.
    options += ["-W", "ignore:overflow encountered:RuntimeWarning"]
    options += ["-W", "ignore:invalid value:RuntimeWarning"]
    options += ["-W", "ignore:Module already imported"]
    status = pytest.main([*options, *tests])
    loaded = sys.modules.get("unload")
    if loaded and not Path(loaded.__file__).is_relative_to(tree):
        return OTHER_CODE
    return int(status)


class Workers:
    """Forked processes, each with a copy of the tree, that run tests side by side.

    Attributes:
        original: a copy that stays as it is, whatever is edited meanwhile.
    """

    def __init__(self, folder: Path, count: int) -> None:
        self.original = folder / "original"
        self._free = [folder / f"copy{number}" for number in range(count)]
        self._running = {}
        for tree in (self.original, *self._free):
            source = ROOT if tree == self.original else self.original
            tree.mkdir()
            for name in COPIED:
                if (source / name).is_dir():
                    shutil.copytree(source / name, tree / name, ignore=NO_CACHE)
                else:
                    shutil.copy2(source / name, tree / name)

    def source(self, module: str) -> Path:
        """The module's file, unchanged."""
        return self.original / "unload" / f"{module}.py"

    def _put(self, tree: Path, module: str, code: str) -> None:
        """Write a module, and remove its bytecode, which is known by size and second only."""
        path = tree / "unload" / f"{module}.py"
        path.write_text(code)
        Path(cache_from_source(path)).unlink(missing_ok=True)

    def start(self, module: str, code: str | None, limit: int, key: object) -> Iterator:
        """Begin one run as soon as a tree is free; yield what ends meanwhile, see ``wait``.

        Args:
            module: whose tests are run.
            code: of the module, or None to leave it as it is.
            limit: processor time in s, because wall time depends on what else runs.
            key: what ``wait`` yields with the outcome.
        """
        while not self._free:
            yield from self.wait()
        tree = self._free.pop()
        self._put(tree, module, self.source(module).read_text() if code is None else code)
        sys.stdout.flush()
        process = os.fork()
        if not process:
            try:
                resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
                os._exit(run_tests(tree, module))
            except BaseException:
                traceback.print_exc()
                os._exit(1)  # the tests did not even start
        self._running[process] = key, tree, module, time.monotonic()

    def wait(self) -> Iterator[tuple[object, str, float, str]]:
        """Key, outcome, processor time and output of ended runs, after at least one has ended."""
        ended = []
        while self._running and not ended:
            time.sleep(0.02)
            for process, (key, tree, module, start) in list(self._running.items()):
                if time.monotonic() - start > WALL_LIMIT:
                    _kill(process)
                done, status, used = os.wait4(process, os.WNOHANG)
                if not done:
                    continue
                _kill(process)  # and what it may have left running
                code = os.waitstatus_to_exitcode(status)
                if code == OTHER_CODE:
                    raise RuntimeError(f"the tests of {module} did not run on {tree}")
                outcome = "killed" if code else "survived"
                if code in (-signal.SIGKILL, -signal.SIGXCPU):
                    outcome = "time limit"
                del self._running[process]
                self._put(tree, module, self.source(module).read_text())
                self._free.append(tree)
                output = (tree / "output.txt").read_text(errors="replace")
                ended.append((key, outcome, used.ru_utime + used.ru_stime, output))
        yield from ended

    def rest(self) -> Iterator[tuple[object, str, float, str]]:
        """Wait for all runs that are under way; see ``wait``."""
        while self._running:
            yield from self.wait()

    def close(self) -> None:
        """End the runs that are under way."""
        for process in self._running:
            _kill(process)


def _kill(process: int) -> None:
    """Kill a process and those that it has started."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process, signal.SIGKILL)


def measure(names: list[str], sample: int, seed: int, jobs: int) -> Iterator[pd.DataFrame]:
    """Run the mutants of some modules: a table a module, with a row and an outcome each.

    Raises:
        RuntimeError: a module's tests fail without any change.
    """
    with (
        tempfile.TemporaryDirectory() as folder,
        contextlib.closing(Workers(Path(folder), jobs)) as workers,
    ):
        for number, name in enumerate(MODULES):
            if name not in names:
                continue
            limit = round(2 * _seconds_unchanged(workers, name) + 10)
            rng = np.random.default_rng([seed, number])
            chosen, count = mutants(workers.source(name), name, sample, rng)
            ends = []
            for mutant in chosen:
                ends += [_row(*end) for end in workers.start(name, mutant.code, limit, mutant)]
            ends += [_row(*end) for end in workers.rest()]
            print(f"{name}: {len(chosen)} of {count} mutants tested", flush=True)
            yield pd.DataFrame(ends).assign(of=count).sort_values(["line", "operator"])


def _seconds_unchanged(workers: Workers, name: str) -> float:
    """Processor time of a module's tests, which have to pass, without a change."""
    ends = [*workers.start(name, None, WALL_LIMIT, None), *workers.rest()]
    ((_, outcome, seconds, output),) = ends
    if outcome != "survived":
        raise RuntimeError(f"the tests of {name} do not pass: {outcome}\n{output}")
    return seconds


def _row(mutant: Mutant, outcome: str, seconds: float, output: str) -> dict:
    """What is kept of a run; survivors are printed, too."""
    failed = re.findall(r"^(?:FAILED|ERROR) (\S+)", output, re.MULTILINE)
    row = asdict(mutant) | {"outcome": outcome, "by": "".join(failed[:1]), "s": round(seconds, 1)}
    del row["code"]
    if outcome == "survived":
        print(f"unload/{mutant.module}.py:{mutant.line} {mutant.operator}")
        print(f"    - {mutant.before}\n    + {mutant.after}", flush=True)
    return row


def scores(table: pd.DataFrame) -> str:
    """Mutants killed, tested and in all by module, and the share killed with a 95 % interval."""
    killed = table["outcome"] != "survived"  # those over time count as killed
    over = table["outcome"] == "time limit"
    counted = table.assign(killed=killed, over_time=over).groupby("module", sort=False)
    rows = counted.agg(
        killed=("killed", "sum"), tested=("killed", "size"), of=("of", "first"),
        over_time=("over_time", "sum"),
    )  # fmt: skip
    rows["score"] = (rows["killed"] / rows["tested"]).map("{:.0%}".format)
    score = scipy.stats.binomtest(int(killed.sum()), len(table))
    low, high = score.proportion_ci(method="wilson")
    return (
        f"{rows.to_string()}\nIn all {killed.sum()} of {len(table)} tested mutants are killed: "
        f"{score.statistic:.1%}, 95 % Wilson interval {low:.1%} to {high:.1%}."
    )


def keep(table: pd.DataFrame, folder: Path = KEPT) -> None:
    """Write ``mutants.csv``, a row a module, and ``survivors.csv``, a row a surviving mutant.

    Modules that are not in ``table`` keep their rows, and survivors that are known already the
    reason in ``why``.
    """
    killed = table["outcome"] != "survived"
    modules = table.assign(killed=killed).groupby("module", as_index=False)
    survivors = table.loc[~killed, ["module", "before", "after"]].drop_duplicates()
    parts = {
        "mutants": modules.agg(
            of=("of", "first"), mutants=("killed", "size"), killed=("killed", "sum")
        ),
        "survivors": survivors.assign(why=""),
    }
    for name, new in parts.items():
        path = folder / f"{name}.csv"
        old = pd.read_csv(path) if path.exists() else new[:0]
        if name == "survivors":
            new = new.drop(columns="why").merge(old, "left", ["module", "before", "after"])
        others = old[~old["module"].isin(table["module"])]
        pd.concat([others, new]).sort_values("module", kind="stable").to_csv(path, index=False)


def main() -> None:
    """Measure, print survivors and scores; keep all in build/mutants.csv."""
    parser = argparse.ArgumentParser(description="Mutation testing.")
    parser.add_argument("modules", nargs="*", help="such as agent/dqn; all if none is given")
    parser.add_argument("--sample", type=int, default=SAMPLE, help="mutants per module, 0 for all")
    parser.add_argument("--seed", type=int, default=SEED, help="of the sample")
    parser.add_argument("--jobs", type=int, default=2, help="processes side by side")
    parser.add_argument("--keep", action="store_true", help="the results in data/benchmarks, too")
    arguments = parser.parse_args()
    for name in arguments.modules:
        if name not in MODULES:
            parser.error(f"modules has {name!r}; expected some of {', '.join(MODULES)}")
    start = time.monotonic()
    names = arguments.modules or list(MODULES)
    (ROOT / "build").mkdir(exist_ok=True)
    parts = []
    for part in measure(names, arguments.sample, arguments.seed, arguments.jobs):
        parts.append(part)
        table = pd.concat(parts, ignore_index=True)
        table.to_csv(ROOT / "build" / "mutants.csv", index=False)
    if arguments.keep:
        keep(table)
    print(scores(table))
    print(f"{(time.monotonic() - start) / 60:.0f} minutes")


if __name__ == "__main__":
    main()
