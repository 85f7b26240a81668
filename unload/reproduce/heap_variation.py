"""Friction, mass and size varied: heaps of other sizes, and networks trained with variation.

    python -m unload.reproduce heap-variation

A third round of recorded picks, on heaps of other sizes, with another friction and mass in each
episode. Networks are learned from all rounds. What is there in ``runs/heap`` is not repeated.
10,000 picks take about 45 minutes of CPU, the heaps 3, and each network as long as one of
``heap-learning``.
"""

from functools import partial
from pathlib import Path

import numpy as np
import torch
from joblib import Parallel, delayed

from unload.heap.boxes import Heap, package_sizes
from unload.heap.env import MAX_PICKS, HeapEnv
from unload.heap.episodes import Episode, episode_from, exploring, picks_of, play
from unload.heap.generate import settled_heap
from unload.heap.learning import STEPS, Learned, fit, joined, load_network, save_network
from unload.reproduce.heap import NAME
from unload.reproduce.heap_learning import (
    PHYSICS,
    ROUNDS,
    SEEDS_LEARNED,
    VARIANTS,
    WEIGHTS,
    network_paths,
    read_picks,
    record_episodes,
)
from unload.reproduce.results import COMMAND, JOBS, keep_all, kept
from unload.support import checks, files

PICKS = 10_000
HEAPS = 30  # of a random size each
SEED = 6000  # of these heaps and of the episodes; no other data uses it
# Each is drawn between its ends, of which the test conditions stay within: a size for each heap;
# for each episode friction and mass on a logarithmic scale.
SCALES = 0.75, 1.15
FRICTIONS = 0.3, 0.8
MASSES = 0.5, 2.5  # kg
KIND, GAMMA = VARIANTS[0]
OPTIONS = JOBS | {
    "--picks": {"type": int, "default": PICKS, "help": "picks to record"},
    "--rounds": {"type": int, "default": ROUNDS, "help": "of heap-learning that were made"},
}


def sized_heap(seed: int, number: int, scale: float, runs_dir: str | Path = files.RUNS) -> Heap:
    """A heap of boxes that are ``scale`` times as large, made once and kept in ``runs/heap``."""
    folder = Path(runs_dir) / NAME / "heaps"
    lists = kept(folder, *sized_job(seed, number, scale)).value
    packages = np.array(lists["packages"])
    return Heap(
        np.array(lists["positions"]),
        np.array(lists["orientations"]),
        package_sizes(packages, scale),
        packages,
    )


def sized_job(seed: int, number: int, scale: float) -> tuple[dict, partial]:
    """The question of ``sized_heap`` and what answers it, see ``keep_all``."""
    question = {"heap": [seed, number], "scale": scale}
    return question, partial(_heap_lists, seed, number, scale)


def _heap_lists(seed: int, number: int, scale: float) -> dict[str, list]:
    heap = settled_heap(np.random.default_rng([seed, number]), scale)
    names = "positions", "orientations", "packages"
    return {name: getattr(heap, name).tolist() for name in names}


def varied_scale(number: int) -> float:
    """Size of the boxes of a heap to train on."""
    return round(float(np.random.default_rng([SEED, number]).uniform(*SCALES)), 3)


def variation_data(
    picks: int = PICKS,
    rounds: int = ROUNDS,
    seeds: int = SEEDS_LEARNED,
    steps: int = STEPS,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = 1,
    progress: bool = True,
) -> list[Path]:
    """Record picks with variation, and learn networks from them and from all rounds before.

    Args:
        picks: to record; episodes that are there count.
        rounds: of ``heap-learning`` that were made; the last one's networks explore.
        seeds: networks.
        steps: see ``fit``.
        runs_dir: where episodes and networks are.
        n_jobs: processes, as in joblib.
        progress: show a progress bar.

    Returns:
        Where the networks are.

    Raises:
        FileNotFoundError: ``heap-learning`` has not made its networks.
    """
    episodes = -(-checks.integer("picks", picks, 1) // MAX_PICKS)
    checks.integer("rounds", rounds, 1, ROUNDS)
    checks.integer("seeds", seeds, 1)
    known = network_paths(rounds - 1, KIND, GAMMA, runs_dir)
    folder = Path(runs_dir) / NAME
    jobs = [sized_job(SEED, number, varied_scale(number)) for number in range(HEAPS)]
    keep_all(folder / "heaps", jobs[:episodes], n_jobs, progress)
    record_episodes(
        {
            _episode_path(number, runs_dir): partial(_varied, number, known, runs_dir)
            for number in range(episodes)
        },
        n_jobs,
        progress,
    )
    paths = [varied_path(seed, runs_dir) for seed in range(seeds)]
    Parallel(n_jobs)(
        delayed(_learn)(path, seed, rounds, episodes, steps, runs_dir)
        for seed, path in enumerate(paths)
        if not path.exists()
    )
    return paths


def varied_path(seed: int, runs_dir: str | Path = files.RUNS) -> Path:
    """Where a network that was trained with variation is kept."""
    return Path(runs_dir) / NAME / "networks" / f"varied_seed{seed}.safetensors"


def varied_paths(runs_dir: str | Path = files.RUNS) -> list[Path]:
    """The networks of all seeds that are there, at least one.

    Raises:
        FileNotFoundError: there is none.
    """
    folder = varied_path(0, runs_dir).parent
    found = sorted(folder.glob("varied_seed*.safetensors"))
    if not found:
        raise FileNotFoundError(
            f"{varied_path(0, runs_dir)} is missing; {COMMAND} heap-variation makes it"
        )
    return found


def _episode_path(number: int, runs_dir: str | Path) -> Path:
    return Path(runs_dir) / NAME / "picks" / "varied" / f"{number:05}.npz"


def _varied(number: int, known: list[Path], runs_dir: str | Path) -> Episode:
    """One exploring episode with its own friction and mass."""
    rng = np.random.default_rng([SEED, HEAPS + number])
    friction, mass = (float(np.exp(rng.uniform(*np.log(ends)))) for ends in (FRICTIONS, MASSES))
    favourite = Learned([load_network(known[number % len(known)])], float(rng.choice(WEIGHTS)))
    place = number % HEAPS
    heap = sized_heap(SEED, place, varied_scale(place), runs_dir)
    env = HeapEnv(heaps=[heap], physics=PHYSICS, friction=friction, mass=mass)
    try:
        return play(env, exploring(rng, favourite), heap, int(rng.integers(2**32)))
    finally:
        env.close()


def _learn(
    path: Path, seed: int, rounds: int, episodes: int, steps: int, runs_dir: str | Path
) -> None:
    torch.set_num_threads(1)
    varied = [
        picks_of(episode_from(files.read_arrays(_episode_path(number, runs_dir))))
        for number in range(episodes)
    ]
    picks = joined([read_picks(runs_dir, range(rounds)), *varied])
    save_network(fit(picks, seed, KIND, GAMMA, steps=steps), path)


PARTS = {
    "heap-variation": ("picks and networks with varied physics", variation_data, OPTIONS),
}
