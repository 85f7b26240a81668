"""Memory and open files before and after a long use of everything that holds a simulator.

    python benchmarks/soak.py

Ten million picks in arrays, a thousand environments opened and dropped without ``close``, and
200 resets of the full physics with boxes of ever new sizes.
"""

import gc
import sys
import time
from collections.abc import Callable
from pathlib import Path

import gymnasium
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # where unload/ is found

import unload
from unload import task
from unload.physics.full import FullPhysics

PICKS, ENVIRONMENTS, RESETS = 10_000_000, 1000, 200


def open_files() -> int:
    """Return the number of open files of this process."""
    return len(list(Path("/proc/self/fd").iterdir()))


def memory() -> float:
    """Return the memory that this process holds, in MiB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 2**20


def pick_in_arrays(picks: int) -> None:
    """Make random picks in 64 containers."""
    envs, rng = gymnasium.make_vec("unload/Container-v0", task.NUM_ENVS), np.random.default_rng(0)
    envs.reset(seed=0)
    for _ in range(picks // task.NUM_ENVS):
        envs.step(rng.integers(task.N_VISIBLE, size=task.NUM_ENVS))


def open_and_drop(count: int) -> None:
    """Open single and vector environments, lift a box in each, and forget them."""
    for seed in range(count):
        if seed % 2:
            env = gymnasium.make("unload/Container-v0", physics="local")
            env.reset(seed=seed)
            env.step(0)
        else:
            envs = gymnasium.make_vec("unload/Container-v0", 2)
            envs.reset(seed=seed)
            envs.step(np.zeros(2, np.int64))


def reset_with_new_sizes(count: int) -> list[float]:
    """Reset the full physics with a wall of another scale each time; return seconds per lift."""
    physics, rng, seconds = FullPhysics(), np.random.default_rng(0), []
    for _ in range(count):
        physics.reset(unload.stack_load(rng, walls=1, scale=float(rng.uniform(0.8, 1.2))))
        start = time.perf_counter()
        physics.lift(0)
        seconds.append(time.perf_counter() - start)
    return seconds


def main(picks: int = PICKS, environments: int = ENVIRONMENTS, resets: int = RESETS) -> None:
    """Print memory and open files after each part."""
    lifts: list[float] = []
    parts: dict[str, Callable] = {
        "everything once": lambda: (
            pick_in_arrays(64_000), open_and_drop(4), reset_with_new_sizes(2)
        ),
        f"{picks:,} picks in arrays": lambda: pick_in_arrays(picks),
        f"{environments:,} environments dropped": lambda: open_and_drop(environments),
        f"{resets} full resets": lambda: lifts.extend(reset_with_new_sizes(resets)),
    }  # fmt: skip
    for name, part in parts.items():
        start = time.perf_counter()
        part()
        gc.collect()
        seconds = time.perf_counter() - start
        print(f"{name:<32} {seconds:7.1f} s {memory():8.0f} MiB {open_files():4} files", flush=True)
    first, last = np.median(lifts[:20]), np.median(lifts[-20:])
    print(f"a lift in full physics: {first:.4f} s in the first resets, {last:.4f} s in the last")


if __name__ == "__main__":
    main()
