"""What the machine could do at best: arithmetic and memory, on one thread."""

import numba
import numpy as np

from benchmarks.timing import best_times
from unload.agent.fast.kernel import long_vectors

CHAIN = 32  # operations on a number once it is loaded


@numba.njit(fastmath={"contract", "nsz"})
def _multiply_and_add(numbers, results):
    """For each number, half as many multiply-adds as ``CHAIN``, and as many additions."""
    long_vectors()
    for i in range(len(numbers)):
        x = numbers[i]
        product, total = x, x
        for _ in range(CHAIN // 2):
            product = product * x + np.float32(0.5)
            total = total + x
        results[i] = product + total


def operations_per_second(rounds: int = 20) -> float:
    """Operations on single precision numbers; a multiply-add is one.

    Measured by a loop that does nothing else, on numbers that stay in the cache, with all
    the vector units that the compiler finds.
    """
    numbers = np.linspace(-1, 1, 4096, dtype=np.float32)
    results = np.empty_like(numbers)

    def compute() -> None:
        for _ in range(100):
            _multiply_and_add(numbers, results)

    (seconds,) = best_times({"compute": compute}, rounds).values()
    return 100 * CHAIN * len(numbers) / seconds


def bytes_per_second(rounds: int = 5) -> float:
    """Bytes read and written while a large array is copied."""
    source = np.ones(2**27, np.uint8)
    copy = np.empty_like(source)
    (seconds,) = best_times({"copy": lambda: np.copyto(copy, source)}, rounds).values()
    return 2 * source.nbytes / seconds
