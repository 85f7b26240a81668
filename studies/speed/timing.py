"""How a call is timed."""

import time
from collections.abc import Callable, Mapping

ROUNDS = 4  # in which each call is timed


def best_times(calls: Mapping[str, Callable[[], object]]) -> dict[str, float]:
    """The least wall time of each call, in s.

    Each is made once without counting. Then all are made in turn, ``ROUNDS`` times, so that
    whatever else the machine does meets all of them alike. The least time is that of the
    round which was disturbed least.
    """
    for call in calls.values():
        call()
    best = dict.fromkeys(calls, float("inf"))
    for _ in range(ROUNDS):
        for name, call in calls.items():
            start = time.perf_counter()
            call()
            best[name] = min(best[name], time.perf_counter() - start)
    return best
