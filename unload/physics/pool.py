"""Processes that simulate lifts side by side, for loads whose situations are ever new."""

import os
import pickle
import subprocess
import sys
import warnings
import weakref
from collections.abc import Callable
from contextlib import closing, suppress

from unload.physics.bullet import engine_of
from unload.physics.local import LocalPhysics
from unload.physics.situation import Situation
from unload.support.compiled import threads

# Not those of ``multiprocessing``, which would run the script that the user has started once more.
# Ctrl-C is for the process that asks. Modules are found where this process finds them, but none in
# the working directory before Python's own.
_COMMAND = (
    "import signal, sys; signal.signal(signal.SIGINT, signal.SIG_IGN); sys.path[:] = sys.argv[1:]; "
    "from unload.physics.pool import serve; serve({!r})"
)
_MOST = 8  # each takes 100 MB, and a step has few new lifts


class Pool:
    """Processes that are started when they are first asked: one for each core, with this one.

    These are as many as numba takes threads, which the environment's ``NUMBA_NUM_THREADS`` sets,
    but at most ``_MOST``. They end with the pool, or with this process, however that ends. A
    process that was forked starts its own. Where one was killed, for want of memory, say, the pool
    warns, and this process does without from then on. ``engine`` simulates, see ``LocalPhysics``.
    """

    def __init__(self, engine: str | None = None) -> None:
        # By name, because the others must not choose otherwise than this process.
        self._command = _COMMAND.format(engine_of(engine))
        self._alone = False
        self._own_workers()

    def _own_workers(self) -> None:
        self._process = os.getpid()
        self._workers: list[subprocess.Popen] = []
        self.close = weakref.finalize(self, _end, self._workers, self._process)

    def simulate(
        self, situations: list[Situation], simulate: Callable[[Situation], float]
    ) -> list[float]:
        """Return how far each chosen box moves, in m; ``simulate`` is for this process's share."""
        if self._process != os.getpid():  # those of the process that was forked are not ours
            self.close()
            self._own_workers()
        count = 1 if self._alone else min(threads(), _MOST)
        distances = [0.0] * len(situations)
        try:
            while len(self._workers) < count - 1:
                paths = [*filter(None, sys.path), os.getcwd()]
                process = subprocess.Popen(
                    [sys.executable, "-I", "-c", self._command, *paths],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                )
                self._workers.append(process)
            # Dealt one by one, because those of one container may take longer than others.
            for number, worker in enumerate(self._workers, 1):
                worker.stdin.write(pickle.dumps(situations[number::count]))
                worker.stdin.flush()
            distances[::count] = [simulate(situation) for situation in situations[::count]]
            for number, worker in enumerate(self._workers, 1):
                distances[number::count] = pickle.load(worker.stdout)
            return distances
        except (EOFError, OSError, pickle.UnpicklingError):
            self._alone = True
            _end(self._workers, self._process)
            warnings.warn("a process that simulates lifts has died; this one does it", stacklevel=2)
            return [simulate(each) for each in situations]
        except BaseException:
            # An answer that nobody has read would be taken for the next one.
            _end(self._workers, self._process)
            raise


def _end(workers: list[subprocess.Popen], owner: int) -> None:
    """End processes; a fork of their owner only forgets them."""
    while workers:
        worker = workers.pop()
        if os.getpid() != owner:
            worker.returncode = 0
            continue
        worker.kill()
        with suppress(BrokenPipeError), worker:
            pass


def serve(engine: str | None = None) -> None:
    """Simulate the situations that come in lists on stdin, and answer on stdout, until it ends.

    What the engine has to say goes to stderr.
    """
    questions, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    with questions, answers, closing(LocalPhysics(engine)) as physics:
        while questions.peek():
            situations = pickle.load(questions)
            pickle.dump([physics.simulate(situation) for situation in situations], answers)
            answers.flush()
