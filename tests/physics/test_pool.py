"""Lifts that several processes share."""

import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import time
from unittest.mock import Mock

import pytest

from tests.agent.runs import ROOT
from unload.physics import pool as pools
from unload.physics import table
from unload.physics.local import LocalPhysics
from unload.physics.pool import Pool
from unload.physics.table import HELD_DOWN, LiftTable, TablePhysics


@pytest.fixture(scope="module", autouse=True)
def three_cores():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pools, "threads", lambda: 3)
        yield


@pytest.fixture(scope="module")
def local() -> LocalPhysics:
    return LocalPhysics()


@pytest.fixture(scope="module")
def pool() -> Pool:
    """One for all tests, because it takes a second to start its processes."""
    return Pool()


@pytest.fixture
def hard(situations):
    """Different situations that a table knows by no rule."""
    different = {each.key: each for each in situations if 0 < each.on_top < HELD_DOWN}
    return list(different.values())[:16]


def test_shared_lifts_are_those_of_one_process(pool, local, hard):
    alone = [local.simulate(each) for each in hard]
    assert len(set(alone)) > 8
    for count in (16, 0, 1, 2, 3):
        assert pool.simulate(hard[:count], local.simulate) == alone[:count]
    assert len(pool._workers) == 2, "they stay"


def test_an_interrupted_call_leaves_no_answer_for_the_next(pool, local, hard):
    with pytest.raises(KeyboardInterrupt):
        pool.simulate(hard, Mock(side_effect=KeyboardInterrupt))
    assert pool.simulate(hard[5:], local.simulate) == [local.simulate(each) for each in hard[5:]]


@pytest.mark.needs("SIGKILL")
def test_lifts_of_a_process_that_was_killed_are_simulated_here(local, hard):
    """With one warning; a training goes on."""
    pool = Pool()
    alone = pool.simulate(hard, local.simulate)
    for worker in pool._workers:
        worker.send_signal(signal.SIGINT)
    assert pool.simulate(hard, local.simulate) == alone, "Ctrl-C is not for them"
    pool._workers[1].kill()
    pool._workers[1].wait()
    with pytest.warns(UserWarning, match="a process that simulates lifts has died") as said:
        for _ in range(2):
            assert pool.simulate(hard, local.simulate) == alone
    assert len(said) == 1


def test_a_process_that_was_forked_starts_its_own(pool, local, hard):
    """With those of its parent, both once read the other's answers."""
    alone = pool.simulate(hard, local.simulate)
    workers = [worker.pid for worker in pool._workers]

    def child() -> None:
        here = LocalPhysics()
        same = pool.simulate(hard, here.simulate) == alone
        own = not {worker.pid for worker in pool._workers} & {*workers}
        pool.close()
        os._exit(0 if same and own else 1)

    process = multiprocessing.get_context("fork").Process(target=child)
    process.start()
    for start in range(8):
        assert pool.simulate(hard[start:], local.simulate) == alone[start:]
    process.join(timeout=100)  # s
    assert process.exitcode == 0
    assert [worker.poll() for worker in pool._workers] == [None, None], "they are not the child's"


def test_nothing_in_the_working_directory_is_executed(tmp_path):
    """A module of one of Python's names, say."""
    for name in ("signal", "pickle"):
        (tmp_path / f"{name}.py").write_text("open('executed', 'w')", encoding="utf-8")
    script = (
        "import sys; path = sys.path.pop(0); from unload.physics.pool import Pool; "
        "sys.path.insert(0, path); pool = Pool(); pool.simulate([1, 2, 3], float); "
        "print(len(pool._workers))"
    )
    environment = os.environ | {"NUMBA_NUM_THREADS": "3", "PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, "-c", script], cwd=tmp_path, env=environment)
    assert not (tmp_path / "executed").exists()


@pytest.mark.needs("/proc")
def test_they_end_with_a_process_that_is_killed():
    script = (
        "import os; from unload.physics.pool import Pool; pool = Pool(); pool.simulate([], None); "
        "print(*[worker.pid for worker in pool._workers], flush=True); os.kill(os.getpid(), 9)"
    )
    environment = os.environ | {"NUMBA_NUM_THREADS": "3"}
    done = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True)
    left = [int(number) for number in done.stdout.split()]
    assert len(left) == 2
    until = time.monotonic() + 20
    while left and time.monotonic() < until:
        left = [number for number in left if os.path.exists(f"/proc/{number}/cmdline")]
        time.sleep(0.05)
    assert not left


def test_what_pybullet_says_is_no_answer():
    script = (
        "import os; from unload.physics.pool import LocalPhysics, serve; "
        "LocalPhysics.simulate = lambda self, lift: os.write(1, b'noise') and 2 * lift; serve()"
    )
    command, question = [sys.executable, "-c", script], pickle.dumps([1, 2])
    done = subprocess.run(command, input=question, capture_output=True, check=True)
    assert pickle.loads(done.stdout) == [2, 4] and done.stderr.endswith(b"noisenoise")


def test_a_table_shares_lifts_where_many_are_new(pool, local, hard, monkeypatch):
    shared = Mock(wraps=pool.simulate)
    monkeypatch.setattr(Pool, "simulate", lambda _, *given: shared(*given))
    monkeypatch.setattr(table, "_PATIENCE", 15)
    physics = TablePhysics(LiftTable())
    for lifts, calls in ((hard[:15], 0), (hard, 1)):  # 15 are not enough
        physics.table = LiftTable()
        assert physics.simulate_all(lifts) == [local.simulate(each) for each in lifts]
        assert shared.call_count == calls and len(physics.table) == len(lifts)
