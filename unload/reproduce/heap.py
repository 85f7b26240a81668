"""Heaps: the stored ones, the physics that pick from them, and what the camera makes of them.

    python -m unload.reproduce heaps              # data/heaps.npz
    python -m unload.reproduce heap-agreement     # data/heap/agreement.csv
    python -m unload.reproduce heap-camera        # data/heap/camera.csv

Everything is kept in ``runs/heap`` in parts: a command that was stopped goes on.
"""

import time
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from unload.heap import camera, generate, rake
from unload.heap.boxes import Heap, package_sizes
from unload.heap.env import HeapEnv, stored_heaps
from unload.heap.episodes import play
from unload.heap.generate import BOXES, settled_heap, write_heaps
from unload.heap.observation import camera_boxes, true_boxes
from unload.heap.rake import PHYSICS, Rake
from unload.heap.rules import random
from unload.physics.bullet import FRICTION
from unload.reproduce.results import COMMAND, JOBS, keep_all, publish
from unload.support import checks, files
from unload.support.provenance import joined, write_provenance

NAME = "heap"
HEAPS = {"train": 70, "test": 30}
SEEDS = {"train": 3000, "test": 4000}  # of the heaps; of recorded picks, the first with more
AGREEMENT_PICKS = 300
AGREEMENT_SEED = 5000
# What an episode depends on besides heap, policy and the arguments of the environment.
CONSTANTS = *rake.CONSTANTS, *camera.CONSTANTS


def heaps_data(
    counts: dict[str, int] = HEAPS,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = 1,
    progress: bool = True,
) -> None:
    """Make the heaps of both splits; write ``heaps.npz`` and its provenance.

    Heap i of a split is the same however many there are.
    """
    names = [
        (split, number)
        for number in range(max(counts.values()))
        for split, count in counts.items()
        if number < count
    ]
    jobs = [heap_job(SEEDS[split], number) for split, number in names]
    answers = keep_all(Path(runs_dir) / NAME / "heaps", jobs, n_jobs, progress)
    heaps: dict[str, list[Heap]] = {split: [] for split in counts}
    for (split, _), answer in zip(names, answers):
        positions, orientations, packages = map(np.array, answer.value.values())
        heaps[split].append(Heap(positions, orientations, package_sizes(packages), packages))
    write_heaps(Path(folder) / "heaps.npz", heaps)
    settings = {"heaps": counts, "seeds": SEEDS, "boxes dropped": BOXES}
    reduced = any(counts[split] < count for split, count in HEAPS.items())
    record = joined(answer.record for answer in answers)
    write_provenance(folder, "heaps", f"{COMMAND} heaps", settings, reduced, record)


def heap_job(
    seed: int, number: int, scale: float = 1.0, friction: float = FRICTION
) -> tuple[dict, partial]:
    """The question of a new heap and what makes it, see ``keep_all``."""
    question = {"heap": [seed, number], "scale": scale, "friction": friction}
    question["constants"] = generate.CONSTANTS
    return question, partial(_heap_lists, seed, number, scale, friction)


def _heap_lists(seed: int, number: int, scale: float, friction: float) -> dict[str, list]:
    """A new heap as lists that can be kept: ``positions``, ``orientations`` and ``packages``."""
    heap = settled_heap(np.random.default_rng([seed, number]), scale, friction)
    names = "positions", "orientations", "packages"
    return {name: getattr(heap, name).tolist() for name in names}


def agreement_data(
    picks: int = AGREEMENT_PICKS,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = 1,
    progress: bool = True,
) -> pd.DataFrame:
    """The same random picks in every physics; write ``heap/agreement.csv`` and provenance.

    On training heaps, each at the start and after 3, 6 and 9 random picks in turn, so that
    heaps that have been dug into are there too.

    Returns:
        One row per pick and physics: ``pick``, ``physics``, ``unloaded``, ``falls``, ``came``,
        ``moved`` (m) and ``cpu_ms``.
    """
    checks.integer("picks", picks, 1)
    heaps = [heap.digest() for heap in stored_heaps("train")]
    jobs = [
        (
            {
                "agreement": number,
                "heap": heaps[number % len(heaps)],
                "seed": AGREEMENT_SEED,
                "constants": CONSTANTS,
            },
            partial(_agreement, number),
        )
        for number in range(picks)
    ]
    answers = keep_all(Path(runs_dir) / NAME / "agreement", jobs, n_jobs, progress)
    rows = [
        {"pick": number, "physics": physics} | row
        for number, answer in enumerate(answers)
        for physics, row in answer.value.items()
    ]
    frame = pd.DataFrame(rows)
    settings = {"picks": picks, "seed": AGREEMENT_SEED, "physics": PHYSICS}
    records = [answer.record for answer in answers]
    command, reduced = f"{COMMAND} heap-agreement", picks < AGREEMENT_PICKS
    place = Path(folder) / NAME
    publish(place, "agreement", {"agreement": frame}, command, settings, reduced, records)
    return frame


def random_pick(number: int) -> tuple[Heap, int, np.random.Generator]:
    """A training heap after 0, 3, 6 or 9 random picks, and a random visible box of it.

    Args:
        number: of the pick, which seeds it.

    Returns:
        The heap, the box, and the generator that has drawn them.
    """
    heaps = stored_heaps("train")
    heap = heaps[number % len(heaps)]
    rng = np.random.default_rng([AGREEMENT_SEED, number])
    before = 3 * (number % 4)
    env = HeapEnv(heaps=[heap], physics="near", max_picks=max(before, 1))
    try:
        if before:
            heap = play(env, random, heap, int(rng.integers(2**32)), keep_heaps=True).heaps[-1]
        env.reset(options={"heap": heap})
        return heap, int(rng.choice(env.visible[env.visible >= 0])), rng
    finally:
        env.close()


def _agreement(number: int) -> dict[str, dict]:
    """One pick in every physics."""
    heap, box, _ = random_pick(number)
    rows = {}
    for physics in PHYSICS:
        rake = Rake(physics)
        start = time.process_time()
        outcome = rake.pick(heap, box)
        rows[physics] = {
            "unloaded": int(outcome.unloaded.sum()),
            "falls": int(outcome.fallen.sum()),
            "came": outcome.came,
            "moved": outcome.moved,
            "cpu_ms": 1000 * (time.process_time() - start),
        }
        rake.close()
    return rows


def camera_data(
    split: str = "test",
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = 1,
    progress: bool = True,
) -> pd.DataFrame:
    """What the camera makes of the stored heaps; write ``heap/camera.csv`` and provenance.

    Returns:
        One row per visible box: ``heap``, ``boxes`` (of the heap), ``pixels``,
        ``centre_error`` (m, length), ``extent_error`` (m, mean over the axes, < 0 where too
        small) and ``tilt_error`` (rad).
    """
    heaps = stored_heaps(split)
    jobs = [
        (
            {"camera": heap.digest(), "constants": camera.CONSTANTS},
            partial(_camera_rows, split, number),
        )
        for number, heap in enumerate(heaps)
    ]
    answers = keep_all(Path(runs_dir) / NAME / "camera", jobs, n_jobs, progress)
    frame = pd.DataFrame([row for answer in answers for row in answer.value])
    settings = {"split": split, "heaps": len(heaps)}
    records = [answer.record for answer in answers]
    place, command = Path(folder) / NAME, f"{COMMAND} heap-camera"
    publish(place, "camera", {"camera": frame}, command, settings, False, records)
    return frame


def _camera_rows(split: str, number: int) -> list[dict]:
    """Errors of every visible box of one heap."""
    heap, scanner = stored_heaps(split)[number], camera.Camera()
    scan = scanner.scan(heap)
    scanner.close()
    true, seen = true_boxes(heap, scan), camera_boxes(heap, scan)
    order = [seen.numbers.tolist().index(box) for box in true.numbers.tolist()]
    columns = {
        "pixels": true.pixels,
        "centre_error": np.linalg.norm(seen.centres[order] - true.centres, axis=1),
        "extent_error": (seen.extents[order] - true.extents).mean(axis=1),
        "tilt_error": np.abs(seen.tilts[order] - true.tilts),
    }
    rows = zip(*(values.tolist() for values in columns.values()))
    return [{"heap": number, "boxes": len(heap)} | dict(zip(columns, row)) for row in rows]


PARTS = {
    "heaps": ("heaps for the bulk pick", heaps_data, JOBS),
    "heap-agreement": ("its three physics on the same picks", agreement_data, JOBS),
    "heap-camera": ("what the camera makes of heaps", camera_data, JOBS),
}
