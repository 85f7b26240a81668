"""Processes that simulate lifts side by side, for loads whose situations are ever new."""

import os
import pickle
import subprocess
import sys
import weakref
from collections.abc import Callable
from contextlib import closing, suppress

from unload.physics.local import LocalPhysics
from unload.physics.situation import Situation
from unload.support.compiled import threads

# Not those of ``multiprocessing``, which would run the script that the user has started once more.
# Ctrl-C is for the process that asks.
COMMAND = (
    "from signal import *; signal(SIGINT, SIG_IGN); from unload.physics.pool import serve; serve()"
)
MOST = 8  # each takes 100 MB, and a step has few new lifts


class Pool:
    """Processes that are started when they are first asked: one for each core, with this one.

    These are as many as numba takes threads, which the environment's ``NUMBA_NUM_THREADS`` sets,
    but at most ``MOST``. They end with the pool, or with this process, however that ends.
    """

    def __init__(self) -> None:
        self._workers: list[subprocess.Popen] = []
        self.close = weakref.finalize(self, _end, self._workers)

    def simulate(
        self, situations: list[Situation], simulate: Callable[[Situation], float]
    ) -> list[float]:
        """Return how far each chosen box moves, in m; ``simulate`` is for this process's share."""
        count, distances = min(threads(), MOST), [0.0] * len(situations)
        try:
            while len(self._workers) < count - 1:
                process = subprocess.Popen(
                    [sys.executable, "-c", COMMAND],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
                )
                self._workers.append(process)
            # Dealt one by one, because those of one container may take longer than others.
            for number, worker in enumerate(self._workers, 1):
                worker.stdin.write(pickle.dumps(situations[number::count]))
                worker.stdin.flush()
            distances[::count] = [simulate(each) for each in situations[::count]]
            for number, worker in enumerate(self._workers, 1):
                distances[number::count] = pickle.load(worker.stdout)
            return distances
        except BaseException as error:
            _end(self._workers)  # an answer that nobody has read would be taken for the next one
            if isinstance(error, (EOFError, OSError)):
                raise RuntimeError("a process that simulates lifts has died") from error
            raise


def _end(workers: list[subprocess.Popen]) -> None:
    while workers:
        worker = workers.pop()
        worker.kill()
        with suppress(BrokenPipeError), worker:
            pass


def serve() -> None:
    """Simulate the situations that come in lists on stdin, and answer on stdout, until it ends.

    What PyBullet has to say goes to stderr.
    """
    questions, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    with questions, answers, closing(LocalPhysics()) as physics:
        while questions.peek():
            situations = pickle.load(questions)
            pickle.dump([physics.simulate(each) for each in situations], answers)
            answers.flush()
