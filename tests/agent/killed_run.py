"""One training run that is killed again and again until it is through.

    python killed_run.py FOLDER CONFIG    (CONFIG: the fields of a TrainConfig as JSON)

It prints how often the run was killed, and how often inside a save. Each life is a fork of
this process, which has imported and compiled everything and has no threads.
"""

import json
import mmap
import os
import random
import signal
import sys
import threading
import time
from collections.abc import Callable

import numpy as np
import torch
from tqdm import tqdm

import unload
from unload.support import files

SAVES = 4  # a life's last save, so that the number of lives depends little on the machine
INSIDE, SAVED = 0, 1  # bytes shared by parent and child: inside a save now; saves made


def die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def watch_saves(shared: mmap.mmap) -> None:
    """Keep the two shared bytes up to date."""
    write = files.write_atomically

    def watched(path, fill) -> None:
        shared[INSIDE] = 1
        write(path, fill)
        shared[INSIDE] = 0
        shared[SAVED] += 1
        if shared[SAVED] == SAVES:
            die()

    files.write_atomically = watched


def die_inside_a_save(moment: int) -> None:
    """Die with a file half written, or right before a call that makes it durable."""
    if moment == 0:

        def half_written(file, **arrays) -> None:
            file.write(b"half a checkpoint")
            file.flush()
            die()

        np.savez = half_written
        return
    left = moment

    def before(call: Callable) -> Callable:
        def counted(*arguments):
            nonlocal left
            left -= 1
            if left == 0:
                die()
            return call(*arguments)

        return counted

    os.fsync, os.replace = before(os.fsync), before(os.replace)


def live(config: unload.TrainConfig, folder: str, shared: mmap.mmap, moment: int | None) -> None:
    """Train in a process of its own, and leave it."""
    watch_saves(shared)
    if moment is not None:
        die_inside_a_save(moment)
    code = 1
    try:
        unload.train(config, folder, progress=False)
        code = 0
    finally:
        os._exit(code)


def main(folder: str, config: unload.TrainConfig) -> None:
    torch.set_num_threads(1)
    tqdm.set_lock(threading.RLock())  # its own is one for all forks: who is killed would keep it
    # Compile and open everything once; the environment of this run is not used.
    unload.train(unload.TrainConfig(**vars(config) | {"seed": 1}), f"{folder}.warm", False)
    shared, rng = mmap.mmap(-1, 2), random.Random(0)
    lives = kills = inside = 0
    while True:
        shared[INSIDE] = shared[SAVED] = 0
        way, lives = lives % 3, lives + 1
        moment = rng.randrange(8) if way == 2 else None
        child = os.fork()
        if child == 0:
            live(config, folder, shared, moment)
        status = wait(child, shared, way, rng)
        if os.WIFEXITED(status):
            break
        kills, inside = kills + 1, inside + shared[INSIDE]
    if os.WEXITSTATUS(status):
        sys.exit("a life failed")
    print(f"{kills} kills, {inside} inside a save; then the run ended")


def wait(child: int, shared: mmap.mmap, way: int, rng: random.Random) -> int:
    """Kill the child at a random moment, unless it dies by itself; its exit status."""
    if way == 0:  # any moment, mostly while starting and restoring
        time.sleep(rng.uniform(0, 0.05))
        os.kill(child, signal.SIGKILL)
    elif way == 1:  # not before it has got on a little
        while not shared[SAVED]:
            gone, status = os.waitpid(child, os.WNOHANG)
            if gone:
                return status
            time.sleep(0.0005)
        time.sleep(rng.uniform(0, 0.02))
        os.kill(child, signal.SIGKILL)
    return os.waitpid(child, 0)[1]


if __name__ == "__main__":
    main(sys.argv[1], unload.TrainConfig(**json.loads(sys.argv[2])))
